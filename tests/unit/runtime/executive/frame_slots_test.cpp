#include "runtime/executive/frame_slots.hpp"

#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "runtime/executive/publish_stage.hpp"

namespace stillmap {
namespace {

using std::chrono::milliseconds;

SourceInfo tiny() {
  SourceInfo info;
  info.camera.k = {10, 10, 4, 3, 8, 6};
  info.has_truth_mask = true;
  return info;
}

TEST(FrameSlots, EachIsHandedOutOnceUntilItIsGivenBack) {
  FrameSlots slots(tiny(), 3);
  std::set<uint32_t> taken;
  uint32_t slot = 0;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(slots.acquire(slot, milliseconds(0)));
    taken.insert(slot);
  }
  EXPECT_EQ(taken.size(), 3u);
  EXPECT_EQ(slots.in_use(), 3u);
  EXPECT_FALSE(slots.acquire(slot, milliseconds(1)));
  slots.release(1);
  ASSERT_TRUE(slots.acquire(slot, milliseconds(0)));
  EXPECT_EQ(slot, 1u);
}

TEST(FrameSlots, TwoThreadsNeverHoldTheSame) {
  FrameSlots slots(tiny(), 4);
  std::array<std::atomic<int>, 4> holders{};
  std::atomic<bool> shared{false};
  const auto work = [&] {
    for (int i = 0; i < 20000; ++i) {
      uint32_t slot = 0;
      if (!slots.acquire(slot, milliseconds(100))) continue;
      if (holders[slot].fetch_add(1) != 0) shared = true;
      holders[slot].fetch_sub(1);
      slots.release(slot);
    }
  };
  std::thread a(work), b(work);
  a.join();
  b.join();
  EXPECT_FALSE(shared);
  EXPECT_EQ(slots.in_use(), 0u);
}

TEST(FrameMailbox, TheNewestFrameWins) {
  FrameMailbox box;
  EXPECT_EQ(box.take(milliseconds(0)), FrameMailbox::kEmpty);
  EXPECT_EQ(box.put(3), FrameMailbox::kEmpty);
  EXPECT_EQ(box.put(5), 3);
  EXPECT_EQ(box.take(milliseconds(0)), 5);
  EXPECT_EQ(box.take(milliseconds(1)), FrameMailbox::kEmpty);
}

TEST(FrameMailbox, EveryFrameIsTakenOrHandedBackOnce) {
  constexpr uint32_t kFrames = 100000;
  FrameMailbox box;
  uint64_t put = 0, handed_back = 0, taken = 0;
  std::atomic<bool> done{false};
  std::thread reader([&] {
    for (bool last = false; !last;) {
      last = done;
      for (int32_t slot; (slot = box.take(milliseconds(last ? 0 : 1))) != FrameMailbox::kEmpty;)
        taken += static_cast<uint64_t>(slot);
    }
  });
  for (uint32_t i = 1; i <= kFrames; ++i) {
    put += i;
    const int32_t older = box.put(i);
    if (older != FrameMailbox::kEmpty) handed_back += static_cast<uint64_t>(older);
  }
  done = true;
  reader.join();
  EXPECT_EQ(put, taken + handed_back);
}

TEST(Latest, TheReaderSeesTheNewestWhole) {
  struct Pair {
    uint64_t a = 0, b = 0;
  };
  Latest<Pair> latest;
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (uint64_t i = 1; i <= 200000; ++i) latest.write({i, ~i});
    done = true;
  });
  uint64_t last = 0;
  bool whole = true, rising = true;
  while (!done) {
    const Pair& pair = latest.read();
    whole = whole && (pair.a == 0 || pair.b == ~pair.a);
    rising = rising && pair.a >= last;
    last = pair.a;
  }
  writer.join();
  EXPECT_TRUE(whole);
  EXPECT_TRUE(rising);
  EXPECT_EQ(latest.read().a, 200000u);
}

}  // namespace
}  // namespace stillmap
