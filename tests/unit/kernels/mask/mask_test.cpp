#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "kernels/backend/cpu/loops.hpp"
#include "kernels/mask/grow_mask.hpp"
#include "kernels/mask/residual_mask.hpp"
#include "tests/support/analytic_map.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::TestImage;
using Mask = TestImage<uint8_t>;

Mask random_mask(int32_t rows, int32_t cols, double share, uint32_t seed) {
  Mask mask(rows, cols);
  std::mt19937 random(seed);
  std::bernoulli_distribution set(share);
  for (int32_t r = 0; r < rows; ++r)
    for (int32_t c = 0; c < cols; ++c) mask.view().at(r, c) = set(random) ? kMasked : uint8_t{0};
  return mask;
}

bool same(const Mask& a, const Mask& b) {
  for (int32_t r = 0; r < a.view().rows; ++r)
    for (int32_t c = 0; c < a.view().cols; ++c)
      if (a.view().at(r, c) != b.view().at(r, c)) return false;
  return true;
}

int32_t count(const Mask& m) {
  int32_t n = 0;
  for (int32_t r = 0; r < m.view().rows; ++r)
    for (int32_t c = 0; c < m.view().cols; ++c) n += m.view().at(r, c) != 0;
  return n;
}

/// Every set pixel of `inner` is set in `outer`.
bool within(const Mask& inner, const Mask& outer) {
  for (int32_t r = 0; r < inner.view().rows; ++r)
    for (int32_t c = 0; c < inner.view().cols; ++c)
      if (inner.view().at(r, c) && !outer.view().at(r, c)) return false;
  return true;
}

Mask brute_force(const Mask& in, int32_t radius, bool erode) {
  const auto v = in.view();
  Mask out(v.rows, v.cols);
  for (int32_t r = 0; r < v.rows; ++r)
    for (int32_t c = 0; c < v.cols; ++c) {
      bool all = true, any = false;
      for (int32_t y = std::max(0, r - radius); y <= std::min(v.rows - 1, r + radius); ++y)
        for (int32_t x = std::max(0, c - radius); x <= std::min(v.cols - 1, c + radius); ++x) {
          all &= v.at(y, x) != 0;
          any |= v.at(y, x) != 0;
        }
      out.view().at(r, c) = (erode ? all : any) ? kMasked : uint8_t{0};
    }
  return out;
}

/// Rows and columns in two parts each, as an engine's threads take them.
Mask eroded(Mask mask, int32_t radius) {
  const int32_t rows = mask.view().rows, cols = mask.view().cols;
  Mask scratch(rows, cols);
  erode_rows(mask.view(), scratch.view(), radius, 0, rows / 2);
  erode_rows(mask.view(), scratch.view(), radius, rows / 2, rows);
  erode_columns(scratch.view(), mask.view(), radius, 0, cols / 3);
  erode_columns(scratch.view(), mask.view(), radius, cols / 3, cols);
  return mask;
}
Mask dilated(Mask mask, int32_t radius) {
  const int32_t rows = mask.view().rows, cols = mask.view().cols;
  Mask scratch(rows, cols);
  dilate_rows(mask.view(), scratch.view(), radius, 0, rows / 2);
  dilate_rows(mask.view(), scratch.view(), radius, rows / 2, rows);
  dilate_columns(scratch.view(), mask.view(), radius, 0, cols / 3);
  dilate_columns(scratch.view(), mask.view(), radius, cols / 3, cols);
  return mask;
}

TEST(Erosion, EqualsBruteForceForEveryRadius) {
  for (const int32_t radius : {0, 1, 2, 5, 16, 40, 100})
    for (const double share : {0.2, 0.9, 0.995, 1.0}) {
      const Mask in = random_mask(23, 37, share, static_cast<uint32_t>(radius + 1));
      EXPECT_TRUE(same(eroded(in, radius), brute_force(in, radius, true))) << radius << " " << share;
    }
}

TEST(Dilation, EqualsBruteForceForEveryRadius) {
  for (const int32_t radius : {0, 1, 2, 5, 16, 40, 100})
    for (const double share : {0.0, 0.002, 0.05, 0.5}) {
      const Mask in = random_mask(23, 37, share, static_cast<uint32_t>(radius + 1));
      EXPECT_TRUE(same(dilated(in, radius), brute_force(in, radius, false))) << radius << " " << share;
    }
}

// Property: growing back what erosion left never leaves the mask; shrinking what dilation gave never loses
// any.
TEST(ErosionAndDilation, OpeningIsWithinAndClosingIsAround) {
  for (uint32_t seed = 1; seed < 20; ++seed) {
    const Mask in = dilated(random_mask(40, 50, 0.01, seed), 3);
    const auto radius = static_cast<int32_t>(seed % 5);
    EXPECT_TRUE(within(dilated(eroded(in, radius), radius), in));
    EXPECT_TRUE(within(in, eroded(dilated(in, radius), radius)));
  }
}

/// Depth of a few levels with noise and holes.
TestImage<float> random_depth(int32_t rows, int32_t cols, uint32_t seed) {
  TestImage<float> depth(rows, cols);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> noise(0, 0.02f);
  std::bernoulli_distribution hole(0.15);
  for (int32_t r = 0; r < rows; ++r)
    for (int32_t c = 0; c < cols; ++c)
      depth.view().at(r, c) =
          hole(random) ? 0.0f : 1.0f + 0.5f * static_cast<float>((r / 11 + c / 13) % 3) + noise(random);
  return depth;
}

Mask flooded(Mask mask, const TestImage<float>& depth, float theta) {
  // One entry a pixel is all the room there may be; the entries behind it must stay as they are.
  const auto pixels = static_cast<uint32_t>(mask.view().pixels());
  std::vector<int32_t> queue(pixels + 16, -7);
  flood_fill(mask.view(), depth.view(), theta, {queue.data(), pixels});
  EXPECT_TRUE(std::all_of(queue.begin() + pixels, queue.end(), [](int32_t x) { return x == -7; }));
  return mask;
}

/// Algorithm 1 by sweeping until nothing changes.
Mask flooded_by_sweeps(Mask mask, const TestImage<float>& depth, float theta) {
  const auto m = mask.view();
  const auto d = depth.view();
  for (bool changed = true; changed;) {
    changed = false;
    for (int32_t r = 0; r < m.rows; ++r)
      for (int32_t c = 0; c < m.cols; ++c) {
        if (!m.at(r, c) || d.at(r, c) == 0.0f) continue;
        const int32_t next[4][2] = {{r - 1, c}, {r + 1, c}, {r, c - 1}, {r, c + 1}};
        for (const auto& [nr, nc] : next) {
          if (!m.contains(nr, nc) || m.at(nr, nc) || d.at(nr, nc) == 0.0f) continue;
          if (std::fabs(d.at(r, c) - d.at(nr, nc)) >= theta * d.at(r, c)) continue;
          m.at(nr, nc) = kMasked;
          changed = true;
        }
      }
  }
  return mask;
}

TEST(FloodFill, EqualsSweepsUntilNothingChanges) {
  for (uint32_t seed = 1; seed <= 30; ++seed) {
    const Mask seeds = random_mask(45, 61, seed % 2 ? 0.002 : 0.02, seed);
    const TestImage<float> depth = random_depth(45, 61, seed + 100);
    for (const float theta : {0.0f, 0.003f, 0.007f, 0.1f})
      EXPECT_TRUE(same(flooded(seeds, depth, theta), flooded_by_sweeps(seeds, depth, theta)))
          << seed << " " << theta;
  }
}

TEST(FloodFill, StopsAtDepthEdges) {
  TestImage<float> depth(20, 30);
  for (int32_t r = 0; r < 20; ++r)
    for (int32_t c = 0; c < 30; ++c) depth.view().at(r, c) = c >= 10 && c < 20 ? 1.0f : 2.0f;
  Mask mask(20, 30);
  mask.view().at(7, 15) = kMasked;
  const Mask grown = flooded(mask, depth, 0.007f);
  for (int32_t r = 0; r < 20; ++r)
    for (int32_t c = 0; c < 30; ++c) EXPECT_EQ(grown.view().at(r, c) != 0, c >= 10 && c < 20);
}

TEST(FloodFill, PixelsWithoutDepthNeitherGrowNorAreReached) {
  TestImage<float> depth(1, 7);
  for (int32_t c = 0; c < 7; ++c) depth.view().at(0, c) = c == 1 || c == 4 ? 0.0f : 1.0f;
  Mask mask(1, 7);
  mask.view().at(0, 1) = kMasked;  // set, without depth: stays set and alone
  mask.view().at(0, 3) = kMasked;
  const Mask grown = flooded(mask, depth, 0.1f);
  const bool expected[7] = {false, true, true, true, false, false, false};
  for (int32_t c = 0; c < 7; ++c) EXPECT_EQ(grown.view().at(0, c) != 0, expected[c]) << c;
}

TEST(FloodFill, ReachesEveryPixelOfAnEvenSurfaceAndNoneFromNothing) {
  TestImage<float> depth(480, 640);
  for (int32_t r = 0; r < 480; ++r) std::fill_n(depth.view().row(r), 640, 2.0f);
  Mask mask(480, 640);
  EXPECT_EQ(count(flooded(mask, depth, 0.007f)), 0);
  mask.view().at(479, 0) = kMasked;
  EXPECT_EQ(count(flooded(mask, depth, 0.007f)), 480 * 640);
}

// Property: a larger theta masks more, never less; so do more seeds.
TEST(FloodFill, IsMonotoneInThetaAndSeeds) {
  for (uint32_t seed = 1; seed < 20; ++seed) {
    const TestImage<float> depth = random_depth(40, 50, seed);
    const Mask few = random_mask(40, 50, 0.003, seed);
    Mask many = few;
    many.view().at(20, 25) = kMasked;
    EXPECT_TRUE(within(flooded(few, depth, 0.002f), flooded(few, depth, 0.005f)));
    EXPECT_TRUE(within(flooded(few, depth, 0.005f), flooded(few, depth, 0.02f)));
    EXPECT_TRUE(within(flooded(few, depth, 0.005f), flooded(many, depth, 0.005f)));
    EXPECT_TRUE(within(few, flooded(few, depth, 0.005f)));
  }
}

/// One pixel that looks along z into a map whose distance is 0.5 - z, free before, unobserved beyond z = 0.6.
class ResidualMaskTest : public testing::Test {
 protected:
  ResidualMaskTest() {
    map_.fill({-1, -1, 0}, {0, 0, 8}, [](Vec3d p) {
      AnalyticSample s;
      s.sdf_m = 0.5 - p.z;
      s.observed = p.z < 0.605;
      return s;
    });
  }
  bool suspect(float z_m, float gamma = 0.5f, float max_m = 5.0f) {
    TestImage<float> depth(1, 8);
    Mask out(1, 8);
    for (int32_t c = 0; c < 8; ++c) {
      depth.view().at(0, c) = z_m;
      out.view().at(0, c) = 77;
    }
    ResidualMaskPass pass{map_.view(), depth.view(), out.view(),         {1000, 1000, 3.5f, 0, 8, 1},
                          {},          max_m,        gamma * 0.1f * 0.1f};
    best_loops().residual_mask(pass, 0, 1);
    for (int32_t c = 0; c < 8; ++c) {
      EXPECT_TRUE(out.view().at(0, c) == 0 || out.view().at(0, c) == kMasked);
      EXPECT_EQ(out.view().at(0, c), out.view().at(0, 0));
    }
    return out.view().at(0, 0) != 0;
  }
  AnalyticMap map_{64};
};

// gamma tau^2 = 0.005 m^2: the square root is 0.07071 m.
TEST_F(ResidualMaskTest, TheSquareOfTheResidualIsWhatIsCompared) {
  EXPECT_FALSE(suspect(0.5f));
  EXPECT_FALSE(suspect(0.5f - 0.0706f));
  EXPECT_TRUE(suspect(0.5f - 0.0708f));
  EXPECT_TRUE(suspect(0.3f));  // long free: tau
  EXPECT_FALSE(suspect(0.5f + 0.0706f));
  EXPECT_TRUE(suspect(0.5f + 0.0708f));
}

TEST_F(ResidualMaskTest, UnobservedUnmeasuredAndTooFarAreNotSuspect) {
  EXPECT_TRUE(suspect(0.595f));
  EXPECT_FALSE(suspect(0.605f));  // one of the eight voxels was never observed
  EXPECT_FALSE(suspect(2.0f));
  EXPECT_FALSE(suspect(0.0f));
  EXPECT_TRUE(suspect(0.3f, 0.5f, 0.31f));
  EXPECT_FALSE(suspect(0.3f, 0.5f, 0.29f));
}

TEST_F(ResidualMaskTest, IsMonotoneInGamma) {
  for (float z_m = 0.32f; z_m < 0.6f; z_m += 0.0037f) {
    bool before = true;
    for (const float gamma : {0.0f, 0.05f, 0.2f, 0.5f, 0.8f, 1.0f}) {
      const bool now = suspect(z_m, gamma);
      EXPECT_TRUE(before || !now) << z_m << " " << gamma;
      before = now;
    }
  }
}

}  // namespace
}  // namespace stillmap
