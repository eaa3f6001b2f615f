#include "kernels/map/volume_view.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/analytic_map.hpp"

namespace stillmap {
namespace {

/// Blocks -2..1 along each axis with random, observed voxels.
class VolumeTest : public testing::Test {
 protected:
  VolumeTest() {
    std::mt19937 random(11);
    std::uniform_int_distribution<int32_t> sdf(-32767, 32767), luma(0, 65280);
    for (int32_t z = -2; z <= 1; ++z)
      for (int32_t y = -2; y <= 1; ++y)
        for (int32_t x = -2; x <= 1; ++x)
          for (VoxelSurface& v : map_.block({x, y, z})->surface)
            v = {static_cast<int16_t>(sdf(random)), static_cast<uint16_t>(luma(random))};
  }
  AnalyticMap map_{128};
};

TEST_F(VolumeTest, CornersAcrossBlockBordersEqualSingleLookUps) {
  const VolumeView view = map_.view();
  BlockCache one;
  RecentBlocks<6> recent;
  for (int32_t z = -16; z < 15; ++z)
    for (int32_t y = -16; y < 15; ++y)
      for (int32_t x = -16; x < 15; ++x) {
        VoxelSurface a[8], b[8];
        ASSERT_TRUE(read_corners(view, {x, y, z}, one, a));
        ASSERT_TRUE(read_corners(view, {x, y, z}, recent, b));
        for (int32_t i = 0; i < 8; ++i) {
          const VoxelSurface& expected = map_.surface({x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)});
          ASSERT_EQ(a[i].sdf, expected.sdf);
          ASSERT_EQ(a[i].luma, expected.luma);
          ASSERT_EQ(b[i].sdf, expected.sdf);
        }
      }
}

TEST_F(VolumeTest, AnUnobservedCornerGivesNoValue) {
  map_.surface({3, 3, 3}).sdf = kSdfUnobserved;
  map_.surface({0, 0, 0}).sdf = kSdfUnobserved;
  const VolumeView view = map_.view();
  BlockCache cache;
  VoxelSurface corners[8];
  for (int32_t z = -3; z < 6; ++z)
    for (int32_t y = -3; y < 6; ++y)
      for (int32_t x = -3; x < 6; ++x) {
        const auto touches = [&](int32_t at) {
          return (x == at || x + 1 == at) && (y == at || y + 1 == at) && (z == at || z + 1 == at);
        };
        EXPECT_EQ(read_corners(view, {x, y, z}, cache, corners), !touches(0) && !touches(3));
      }
}

TEST_F(VolumeTest, OutsideOfTheMapGivesNoValue) {
  const VolumeView view = map_.view();
  BlockCache cache;
  VoxelSurface corners[8];
  float sdf_m = 0;
  EXPECT_FALSE(
      read_corners(view, {15, 0, 0}, cache, corners));  // its neighbour lies in a block that is not there
  EXPECT_TRUE(read_corners(view, {14, 0, 0}, cache, corners));
  EXPECT_FALSE(read_corners(view, {0, -17, 0}, cache, corners));
  EXPECT_FALSE(sample_sdf(view, Vec3{1.0f, 0, 0}, cache, sdf_m));
  EXPECT_FALSE(read_corners(view, {16, 16, 16}, cache, corners));
  EXPECT_TRUE(read_corners(view, {0, 0, 0}, cache, corners));  // the cache keeps nothing wrong
}

TEST(Trilinear, IsTheCornerAtACornerAndTheMeanInTheMiddle) {
  const float c[8] = {1, 2, 3, 4, 5, 6, 7, 8};
  for (int32_t i = 0; i < 8; ++i) {
    const Vec3 f = {static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2)};
    EXPECT_FLOAT_EQ(trilinear(c, f), c[i]);
  }
  EXPECT_FLOAT_EQ(trilinear(c, Vec3{0.5f, 0.5f, 0.5f}), 4.5f);
}

TEST(Trilinear, ReproducesEveryProductOfLinearFunctions) {
  const auto f = [](double x, double y, double z) {
    return 2 + x - 3 * y + 0.5 * z + 4 * x * y - x * z + 2 * y * z - 5 * x * y * z;
  };
  double c[8];
  for (int32_t i = 0; i < 8; ++i) c[i] = f(i & 1, i >> 1 & 1, i >> 2);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int n = 0; n < 500; ++n) {
    const Vec3d at = {unit(random), unit(random), unit(random)};
    EXPECT_NEAR(trilinear(c, at), f(at.x, at.y, at.z), 1e-12);
  }
}

TEST(Trilinear, GradientEqualsFiniteDifferences) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> value(-1, 1), inside(0.05, 0.95);
  constexpr double kStep = 1e-5;
  for (int n = 0; n < 500; ++n) {
    double c[8];
    for (double& x : c) x = value(random);
    const Vec3d f = {inside(random), inside(random), inside(random)};
    Vec3d gradient;
    EXPECT_DOUBLE_EQ(trilinear(c, f, gradient), trilinear(c, f));
    const auto slope = [&](Vec3d e) {
      return (trilinear(c, f + kStep * e) - trilinear(c, f - kStep * e)) / (2 * kStep);
    };
    EXPECT_NEAR(gradient.x, slope({1, 0, 0}), 1e-9);
    EXPECT_NEAR(gradient.y, slope({0, 1, 0}), 1e-9);
    EXPECT_NEAR(gradient.z, slope({0, 0, 1}), 1e-9);
  }
}

TEST(Volume, CellOfPointsOnBothSidesOfZero) {
  for (const float x : {-2.5f, -1.0f, -0.25f, 0.0f, 0.75f, 3.0f}) {
    const GridCell<float> cell = cell_of(Vec3{x, x, x});
    EXPECT_EQ(cell.x, static_cast<int32_t>(std::floor(x)));
    EXPECT_FLOAT_EQ(static_cast<float>(cell.y) + cell.fraction.y, x);
    EXPECT_GE(cell.fraction.z, 0.0f);
    EXPECT_LT(cell.fraction.z, 1.0f);
  }
}

TEST(Volume, SampledDistanceOfAPlaneIsExactAndContinuousOverBlockBorders) {
  const Vec3d normal = normalized(Vec3d{0.3, -0.5, 0.8});
  AnalyticMap map(600);
  map.fill({-2, -2, -2}, {1, 1, 1}, [&](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = 0.3 * plane_sdf(p, {0.01, 0, 0}, normal);
    return s;
  });
  const VolumeView view = map.view();
  std::mt19937 random(8);
  std::uniform_real_distribution<float> position(-0.15f, 0.14f);
  RecentBlocks<6> cache;
  for (int n = 0; n < 2000; ++n) {
    const Vec3 p = {position(random), position(random), position(random)};
    float sdf_m = 0;
    ASSERT_TRUE(sample_sdf(view, p, cache, sdf_m));
    const Vec3d exact = {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
    EXPECT_NEAR(static_cast<double>(sdf_m), 0.3 * plane_sdf(exact, {0.01, 0, 0}, normal), 5e-6);
  }
}

}  // namespace
}  // namespace stillmap
