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
  box.newest_wins();
  EXPECT_EQ(box.take(milliseconds(0)), FrameMailbox::kEmpty);
  box.put(3);
  EXPECT_EQ(box.crowded_out(), FrameMailbox::kEmpty);
  box.put(5);
  EXPECT_EQ(box.crowded_out(), 3);
  EXPECT_EQ(box.crowded_out(), FrameMailbox::kEmpty);
  EXPECT_EQ(box.take(milliseconds(0)), 5);
  EXPECT_EQ(box.take(milliseconds(1)), FrameMailbox::kEmpty);
}

TEST(FrameMailbox, AtTheStartAFewWaitInTheirOrder) {
  FrameMailbox box;
  EXPECT_TRUE(box.empty());
  for (const uint32_t slot : {0u, 63u, 7u, 5u}) {
    box.put(slot);
    EXPECT_EQ(box.crowded_out(), FrameMailbox::kEmpty);
  }
  EXPECT_FALSE(box.empty());
  box.put(9);
  EXPECT_EQ(box.crowded_out(), 0);
  EXPECT_EQ(box.take(milliseconds(0)), 63);
  box.newest_wins();
  box.put(11);
  EXPECT_EQ(box.crowded_out(), 7);
  EXPECT_EQ(box.crowded_out(), 5);
  EXPECT_EQ(box.crowded_out(), 9);
  EXPECT_EQ(box.crowded_out(), FrameMailbox::kEmpty);
  EXPECT_EQ(box.take(milliseconds(0)), 11);
  EXPECT_TRUE(box.empty());
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
    const uint32_t slot = i % FrameSlots::kMost;
    put += slot;
    box.put(slot);
    for (int32_t older; (older = box.crowded_out()) != FrameMailbox::kEmpty;)
      handed_back += static_cast<uint64_t>(older);
    if (i == kFrames / 2) box.newest_wins();
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
