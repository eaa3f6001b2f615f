#include "kernels/backend/cpu/arena.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <string>

namespace stillmap {
namespace {

/// What some part takes.
struct Parts {
  View<uint8_t> bytes;
  View<double> numbers;
  ImageView<float> image;

  void carve(Arena& arena) {
    bytes = arena.take<uint8_t>("small", 5);
    numbers = arena.take<double>("large", 1000);
    image = arena.take_image<float>("small", 7, 9);
  }
};

TEST(Arena, MeasuresExactlyWhatItLaterGives) {
  Arena plan;
  Parts parts;
  parts.carve(plan);
  EXPECT_TRUE(plan.measuring());
  EXPECT_EQ(parts.numbers.data, nullptr);
  uint64_t sum = 0;
  for (uint32_t i = 0; i < plan.items().count; ++i) sum += plan.items().item[i].bytes;
  EXPECT_EQ(sum, plan.items().total_bytes);
  EXPECT_EQ(plan.items().count, 2u);  // the same name is one line

  Arena arena(plan.items().total_bytes);
  ASSERT_FALSE(arena.failed());
  parts.carve(arena);
  EXPECT_EQ(arena.items().total_bytes, plan.items().total_bytes);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(parts.bytes.data) % 64, 0u);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(parts.numbers.data) % 4096, 0u);  // from a page up
  EXPECT_EQ(reinterpret_cast<uintptr_t>(parts.image.data) % 64, 0u);
  EXPECT_EQ(parts.image.pixels(), 63);
  for (double& x : parts.numbers) EXPECT_EQ(x, 0.0);
  for (double& x : parts.numbers) x = 1;
  for (const uint8_t b : parts.bytes) EXPECT_EQ(b, 0);
  for (int32_t i = 0; i < 63; ++i) EXPECT_EQ(parts.image.data[i], 0.0f);  // nothing overlaps
}

TEST(Arena, TouchesAllPagesButThoseForLater) {
  constexpr uint64_t kPage = 4096, kPages = 64;
  Arena arena((kPages + 2) * kPage);
  ASSERT_FALSE(arena.failed());
  const View<uint8_t> all = arena.take<uint8_t>("pages", kPages * kPage),
                      more = arena.take<uint8_t>("more", 5);
  all[3 * kPage] = 7;
  unsigned char resident[kPages] = {};
  constexpr int kNoAdvice = 12345;
  if (madvise(all.data, kPage, kNoAdvice) == 0) GTEST_SKIP() << "a system that takes no advice (an emulator)";
  arena.touch_all_but(all.data + 10 * kPage + 1, all.data + 50 * kPage);
  ASSERT_EQ(mincore(all.data, kPages * kPage, resident), 0);
  for (uint64_t page = 0; page < kPages; ++page)
    EXPECT_EQ(resident[page] & 1, page <= 10 || page >= 50 ? 1 : 0) << page;
  ASSERT_EQ(mincore(more.data, 1, resident), 0);
  EXPECT_EQ(resident[0] & 1, 1);
  EXPECT_EQ(all[3 * kPage], 7);
}

TEST(Arena, SaysWhenThereIsNoSuchMemory) {
  const Arena arena(1ull << 62);
  EXPECT_TRUE(arena.failed());
}

}  // namespace
}  // namespace stillmap
