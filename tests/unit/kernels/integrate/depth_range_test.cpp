#include "kernels/integrate/depth_range.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/range_pyramid.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::RangePyramid;
using test::TestImage;

TestImage<float> random_depth(int32_t rows, int32_t cols, std::mt19937& random) {
  TestImage<float> depth(rows, cols);
  std::uniform_real_distribution<float> z(0.5f, 4.0f);
  std::bernoulli_distribution hole(0.01);
  for (int32_t r = 0; r < rows; ++r)
    for (int32_t c = 0; c < cols; ++c) depth.view().at(r, c) = hole(random) ? 0.0f : z(random);
  return depth;
}

DepthRange brute_force(ImageView<const float> depth, int32_t r0, int32_t r1, int32_t c0, int32_t c1) {
  DepthRange range = {1e30f, 0};
  for (int32_t r = std::max(r0, 0); r <= std::min(r1, depth.rows - 1); ++r)
    for (int32_t c = std::max(c0, 0); c <= std::min(c1, depth.cols - 1); ++c)
      range = merged(range, range_of(depth.at(r, c)));
  return range;
}

TEST(DepthRange, QueryHoldsTheRectangleAndLittleMore) {
  std::mt19937 random(6);
  for (const auto& [rows, cols] : {std::pair{64, 96}, {61, 93}, {8, 8}, {7, 200}, {1, 1}, {120, 160}}) {
    const TestImage<float> depth = random_depth(rows, cols, random);
    RangePyramid pyramid(rows, cols);
    pyramid.build(depth.view(), {});
    std::uniform_int_distribution<int32_t> row(0, rows - 1), col(0, cols - 1);
    for (int n = 0; n < 2000; ++n) {
      const auto [r0, r1] = std::minmax({row(random), row(random)});
      const auto [c0, c1] = std::minmax({col(random), col(random)});
      const DepthRange got = pyramid.view().query(r0, r1, c0, c1, 2 + n % 4);
      const DepthRange exact = brute_force(depth.view(), r0, r1, c0, c1);
      EXPECT_LE(got.min_m, exact.min_m);
      EXPECT_GE(got.max_m, exact.max_m);
      EXPECT_LE(got.nearest_m, exact.nearest_m);
      // Not more than a tile to each side, and tiles are at most as long as the rectangle, or 8 pixels.
      const int32_t margin = std::max({r1 - r0, c1 - c0, kTilePx});
      const DepthRange around = brute_force(depth.view(), r0 - margin, r1 + margin, c0 - margin, c1 + margin);
      EXPECT_GE(got.min_m, around.min_m);
      EXPECT_LE(got.max_m, around.max_m);
      EXPECT_GE(got.nearest_m, around.nearest_m);
    }
  }
}

TEST(DepthRange, MaskedPixelsAreNoStaticMeasurement) {
  TestImage<float> depth(16, 16);
  TestImage<uint8_t> mask(16, 16);
  for (int32_t r = 0; r < 16; ++r)
    for (int32_t c = 0; c < 16; ++c) depth.view().at(r, c) = 1.0f + static_cast<float>(c);
  mask.view().at(3, 15) = 255;
  RangePyramid pyramid(16, 16);
  pyramid.build(depth.view(), mask.view());
  EXPECT_EQ(pyramid.static_depth().at(3, 15), 0.0f);
  EXPECT_EQ(pyramid.static_depth().at(3, 14), 15.0f);
  EXPECT_EQ(pyramid.view().query(0, 7, 8, 15).min_m, 0.0f);
  EXPECT_EQ(pyramid.view().query(0, 7, 8, 15).max_m, 16.0f);  // of another row
  EXPECT_EQ(pyramid.view().query(0, 7, 8, 15).nearest_m, 9.0f);
  EXPECT_EQ(pyramid.view().query(8, 15, 8, 15).min_m, 9.0f);
}

TEST(DepthRange, AllMaskedSeesNothing) {
  TestImage<float> depth(9, 17);
  TestImage<uint8_t> mask(9, 17);
  for (int32_t r = 0; r < 9; ++r)
    for (int32_t c = 0; c < 17; ++c) depth.view().at(r, c) = 2.0f, mask.view().at(r, c) = 255;
  RangePyramid pyramid(9, 17);
  pyramid.build(depth.view(), mask.view());
  EXPECT_EQ(pyramid.view().query(0, 8, 0, 16).max_m, 0.0f);
}

}  // namespace
}  // namespace stillmap
