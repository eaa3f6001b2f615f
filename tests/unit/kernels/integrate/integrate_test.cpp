#include "kernels/integrate/integrate_pass.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "kernels/backend/cpu/loops.hpp"
#include "kernels/integrate/visible_blocks.hpp"
#include "tests/support/analytic_map.hpp"
#include "tests/support/range_pyramid.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::RangePyramid;
using test::TestImage;

// --- what a frame says about a voxel ---

class ObserveTest : public testing::Test {
 protected:
  ObserveTest() : depth_(3, 4) {
    for (int32_t r = 0; r < 3; ++r)
      for (int32_t c = 0; c < 4; ++c) depth_.view().at(r, c) = 2.0f;
    geometry_ = {depth_.view(), {100, 100, 1.5f, 1, 4, 3}, 0.3f, 4.0f, 3.0f, 0.1f};
  }
  Observation<float> at(float u, float v, float z_m) {
    return observe(geometry_, unproject(geometry_.k, u, v, z_m));
  }
  TestImage<float> depth_;
  FrameGeometry geometry_;
};

TEST_F(ObserveTest, FreeBandAndHidden) {
  const auto expect = [&](float z_m, bool free, bool band) {
    const Observation<float> o = at(1, 1, z_m);
    EXPECT_EQ(o.free, free) << z_m;
    EXPECT_EQ(o.band, band) << z_m;
    EXPECT_NEAR(band ? o.sdf_m : 2.0f - z_m, 2.0f - z_m, 1e-6f);
  };
  expect(0.2f, false, false);  // nearer than the camera sees
  expect(0.5f, true, false);
  expect(1.89f, true, false);
  expect(1.91f, false, true);
  expect(2.0f, false, true);
  expect(2.09f, false, true);
  expect(2.11f, false, false);  // hidden
  expect(-1.0f, false, false);
}

TEST_F(ObserveTest, TheNearestPixelCountsAndNothingOutsideOfTheImage) {
  depth_.view().at(1, 2) = 1.5f;
  EXPECT_EQ(at(1.6f, 1.4f, 1.0f).pixel, 1 * 4 + 2);
  EXPECT_NEAR(at(2.4f, 0.6f, 1.45f).sdf_m, 0.05f, 1e-6f);
  EXPECT_TRUE(at(-0.45f, -0.45f, 1.0f).free);
  EXPECT_TRUE(at(3.45f, 2.45f, 1.0f).free);
  for (const auto& [u, v] :
       {std::pair{-0.6f, 1.0f}, {3.6f, 1.0f}, {1.0f, -0.6f}, {1.0f, 2.6f}, {1e9f, 0.0f}}) {
    const Observation<float> o = at(u, v, 1.0f);
    EXPECT_FALSE(o.free || o.band);
    EXPECT_GE(o.pixel, 0);
    EXPECT_LT(o.pixel, 12);
  }
}

TEST_F(ObserveTest, NoMeasurementSaysNothing) {
  depth_.view().at(1, 1) = 0.0f;
  for (float z_m = 0.1f; z_m < 5; z_m += 0.1f) EXPECT_FALSE(at(1, 1, z_m).free || at(1, 1, z_m).band);
}

TEST_F(ObserveTest, BeforeAMoverItIsFreeAndAtItNothingIsKnown) {
  for (int32_t i = 0; i < depth_.view().pixels(); ++i) depth_.view().data[i] = -2.0f;
  EXPECT_TRUE(at(1, 1, 1.0f).free);
  EXPECT_TRUE(at(1, 1, 2.0f - 0.05f).free);  // nearer than tau: no surface is fused there
  for (const float z_m : {2.0f - 0.03f, 2.0f, 2.05f, 3.0f}) {
    EXPECT_FALSE(at(1, 1, z_m).free) << z_m;
    EXPECT_FALSE(at(1, 1, z_m).band) << z_m;
  }
}

TEST_F(ObserveTest, TooFarAMeasurementFreesUpToTheClippingPlaneAndFusesNothing) {
  depth_.view().at(1, 1) = 4.5f;  // max_m is 4, the clipping plane 3
  for (float z_m = 0.35f; z_m < 6; z_m += 0.1f) {
    EXPECT_EQ(at(1, 1, z_m).free, z_m <= 3.0f) << z_m;
    EXPECT_FALSE(at(1, 1, z_m).band) << z_m;
  }
  depth_.view().at(1, 1) = 3.5f;  // fused, though behind the clipping plane
  EXPECT_TRUE(at(1, 1, 3.45f).band);
  EXPECT_FALSE(at(1, 1, 3.2f).free);
}

// --- running means ---

constexpr FuseWeights kWeights = {static_cast<float>(kSdfMax) / 0.1f, 64};
constexpr Observation<float> kFree = {true, false, 0.0f, 0};
constexpr Observation<float> band_at(float sdf_m) {
  return {false, true, sdf_m, 0};
}
constexpr VoxelState<float> kUnobserved = {-32768.0f, 0, 0, 0, 128, 128};

/// Distance and colour, as a voxel in the band or in free space gets them.
VoxelState<float> fused(VoxelState<float> v, const Observation<float>& o, float luma, float cb, float cr,
                        const FuseWeights& weights, float dither01) {
  return fused_colour(fused_distance(v, o, weights), o, luma, cb, cr, weights, dither01);
}

TEST(Fused, TheFirstObservationIsTaken) {
  const auto v = fused(kUnobserved, band_at(0.05f), 12345.0f, 100.0f, 200.0f, kWeights, 0.7f);
  EXPECT_NEAR(v.sdf, 16383.5f, 0.51f);
  EXPECT_EQ(v.luma, 12345.0f);
  EXPECT_EQ(v.cb, 100.0f);
  EXPECT_EQ(v.cr, 200.0f);
  EXPECT_EQ(v.weight, 1.0f);
  EXPECT_EQ(v.colour_weight, 1.0f);
  const auto free = fused(kUnobserved, kFree, 0.0f, 0.0f, 0.0f, kWeights, 0.0f);
  EXPECT_EQ(free.sdf, static_cast<float>(kSdfMax));
  EXPECT_EQ(free.weight, 1.0f);
  EXPECT_EQ(free.colour_weight, 0.0f);
}

TEST(Fused, WithoutAnObservationNothingChanges) {
  const VoxelState<float> v = {-100, 5, 6, 7, 8, 9};
  const auto w = fused(v, {false, false, 0.03f, 0}, 60000.0f, 1.0f, 2.0f, kWeights, 0.9f);
  EXPECT_EQ(std::memcmp(&v, &w, sizeof v), 0);
}

TEST(Fused, WeightsStopAtTheCapAndAtOneTheLastCounts) {
  VoxelState<float> v = kUnobserved;
  for (int n = 1; n < 100; ++n) {
    v = fused(v, band_at(0.01f), 1.0f, 1.0f, 1.0f, kWeights, 0.0f);
    EXPECT_EQ(v.weight, static_cast<float>(std::min(n, 64)));
    EXPECT_EQ(v.colour_weight, static_cast<float>(std::min(n, 64)));
  }
  const FuseWeights half = {kWeights.units_per_m, 1};  // mean of the old and the new
  v = fused({1000, 100, 1, 1, 10, 10}, band_at(0.0f), 300.0f, 20.0f, 30.0f, half, 0.0f);
  EXPECT_EQ(v.sdf, 500.0f);
  EXPECT_EQ(v.luma, 200.0f);
  EXPECT_EQ(v.weight, 1.0f);
}

TEST(Fused, AConstantStaysWhatItIs) {
  for (const float cap : {1.0f, 5.0f, 64.0f, 255.0f})
    for (int value = 0; value < 256; value += 5) {
      const FuseWeights weights = {kWeights.units_per_m, cap};
      const float luma = static_cast<float>(value * 256), chroma = static_cast<float>(value);
      const float sdf_m = 0.0007f * static_cast<float>(value - 128);
      VoxelState<float> v = kUnobserved;
      for (int32_t n = 0; n < 1000; ++n) {
        v = fused(v, band_at(sdf_m), luma, chroma, 255.0f - chroma, weights, dither<float>(value, n));
        ASSERT_NEAR(v.luma, luma, 256.0f);  // a grey level
        ASSERT_NEAR(v.cb, chroma, 1.0f);
        ASSERT_NEAR(v.cr, 255.0f - chroma, 1.0f);
        ASSERT_NEAR(v.sdf, sdf_m * weights.units_per_m, 1.0f);
      }
    }
}

// Many voxels see the same noisy values; what is left of the noise averages out, a bias would not.
TEST(Fused, MeansConvergeWithoutBias) {
  constexpr int32_t kVoxels = 400;
  constexpr float kLuma = 117.37f * 256, kCb = 131.4f, kCr = 97.63f, kSdfM = -0.01234f;
  std::mt19937 random(21);
  std::normal_distribution<float> noise(0, 3.0f), depth_noise(0, 0.004f);
  double luma = 0, cb = 0, cr = 0, sdf_m = 0, cb_square = 0;
  for (int32_t voxel = 0; voxel < kVoxels; ++voxel) {
    VoxelState<float> v = {20000, 30000, 64, 64, 100, 120};  // something else was there before
    for (int32_t frame = 0; frame < 1000; ++frame)
      v = fused(v, band_at(kSdfM + depth_noise(random)), std::round(kLuma + 256 * noise(random)),
                std::round(kCb + noise(random)), std::round(kCr + noise(random)), kWeights,
                dither<float>(voxel, frame));
    luma += static_cast<double>(v.luma) / 256 / kVoxels;
    cb += static_cast<double>(v.cb) / kVoxels;
    cr += static_cast<double>(v.cr) / kVoxels;
    cb_square += static_cast<double>((v.cb - kCb) * (v.cb - kCb)) / kVoxels;
    sdf_m += static_cast<double>(v.sdf / kWeights.units_per_m) / kVoxels;
  }
  EXPECT_NEAR(luma, static_cast<double>(kLuma) / 256, 0.1);
  EXPECT_NEAR(cb, static_cast<double>(kCb), 0.3);
  EXPECT_NEAR(cr, static_cast<double>(kCr), 0.3);
  EXPECT_NEAR(sdf_m, static_cast<double>(kSdfM), 1e-4);
  EXPECT_LT(std::sqrt(cb_square), 6.0);  // rounding up or down by chance is noise, but stays bounded
}

TEST(Fused, DitherIsEvenlySpreadOverFramesAndVoxels) {
  for (const bool by_frame : {true, false}) {
    double sum = 0;
    int32_t below_quarter = 0;
    for (int32_t i = 0; i < 10000; ++i) {
      const float d = by_frame ? dither<float>(12345, i) : dither<float>(i, 77);
      ASSERT_GE(d, 0.0f);
      ASSERT_LT(d, 1.0f);
      sum += static_cast<double>(d);
      below_quarter += d < 0.25f;
    }
    EXPECT_NEAR(sum / 10000, 0.5, 0.02);
    EXPECT_NEAR(below_quarter, 2500, 200);
  }
}

TEST(Fused, WhatIsSeenFreeLongEnoughIsExactlyFree) {
  for (const float start : {-32767.0f, -5000.0f, 0.0f, 32000.0f, 32766.0f})
    for (const float cap : {1.0f, 64.0f, 255.0f}) {
      VoxelState<float> v = {start, 100, cap, cap, 90, 80};
      int frames = 0;
      for (; v.sdf < static_cast<float>(kSdfMax) && frames < 10000; ++frames) {
        const float before = v.sdf;
        v = fused(v, kFree, 0.0f, 0.0f, 0.0f, {kWeights.units_per_m, cap}, 0.0f);
        ASSERT_GT(v.sdf, before);
      }
      EXPECT_EQ(v.sdf, static_cast<float>(kSdfMax));
      EXPECT_LT(frames, 9 * (static_cast<int>(cap) + 2));
      EXPECT_EQ(v.luma, 100.0f);  // free space has no colour to give
    }
}

TEST(Fused, RelearningTurnsAFreeVoxelAtOnceAndLeavesASurfaceAlone) {
  FuseWeights quick = kWeights;
  quick.relearn = true;
  const float tau = static_cast<float>(kSdfMax);
  const Observation<float> surface = {false, true, 0.0f, 0};
  VoxelState<float> slow = {tau, 0, 64, 0, 128, 128}, fast = slow, known = {0.1f * tau, 0, 64, 64, 128, 128};
  for (int i = 0; i < 6; ++i) {
    slow = fused(slow, surface, 0.0f, 128.0f, 128.0f, kWeights, 0.0f);
    fast = fused(fast, surface, 0.0f, 128.0f, 128.0f, quick, 0.0f);
    known = fused(known, surface, 0.0f, 128.0f, 128.0f, quick, 0.0f);
  }
  EXPECT_GT(slow.sdf, 0.8f * tau);
  EXPECT_LT(fast.sdf, 0.1f * tau);
  EXPECT_EQ(known.weight, 64.0f);
}

TEST(Fused, RelearningCarvesASurfaceThatIsSeenThroughInFewLooks) {
  FuseWeights quick = kWeights;
  quick.relearn = true;
  const float tau = static_cast<float>(kSdfMax);
  const auto looks_until_free = [&](const FuseWeights& weights, float start) {
    VoxelState<float> v = {start, 0, 64, 64, 128, 128};
    int looks = 0;
    for (; v.sdf < kFreeShare * tau && looks < 1000; ++looks)
      v = fused(v, kFree, 0.0f, 0.0f, 0.0f, weights, 0.0f);
    return looks;
  };
  EXPECT_GT(looks_until_free(kWeights, -0.5f * tau), 40);
  EXPECT_LT(looks_until_free(quick, -0.5f * tau), 20);
  // One look through the edge of a surface does not hurt it.
  VoxelState<float> edge = {0.0f, 0, 64, 64, 128, 128};
  edge = fused(edge, kFree, 0.0f, 0.0f, 0.0f, quick, 0.0f);
  EXPECT_LT(edge.sdf, 0.02f * tau);
  EXPECT_EQ(edge.weight, 58.0f);
}

TEST(Fused, AFreeVoxelThatIsFoundOccupiedTurnsWithinTheCap) {
  VoxelState<float> v = {static_cast<float>(kSdfMax), 0, 64, 0, 128, 128};
  int frames = 0;
  for (; v.sdf > 0 && frames < 1000; ++frames)
    v = fused(v, band_at(-0.05f), 100.0f, 128.0f, 128.0f, kWeights, 0.0f);
  EXPECT_LT(frames, 100);
}

// --- blocks against a frame ---

constexpr int32_t kFusedRows = 48, kFusedCols = 64;
constexpr float kFusedVoxelM = 0.02f, kFusedTruncationM = 0.08f;
constexpr float kCap = 4;
constexpr int kCarveFrames = 50;

/// A map, and all that is needed to bring frames into it; what the engine does, in plain loops.
class Mapper {
 public:
  Mapper()
      : depth_m(kFusedRows, kFusedCols),
        mask(kFusedRows, kFusedCols),
        colour(kFusedRows, kFusedCols),
        ranges_(kFusedRows, kFusedCols) {
    for (int32_t r = 0; r < kFusedRows; ++r)
      for (int32_t c = 0; c < kFusedCols; ++c) {
        depth_m.view().at(r, c) = 1.5f;
        colour.view().at(r, c) = {static_cast<uint16_t>(1000 * (r % 40)), static_cast<uint8_t>(4 * c), 140};
      }
  }

  void integrate(const Se3& T_cam_map = {}) {
    ranges_.build(depth_m.view(), mask.view());
    const FrameGeometry geometry{
        ranges_.static_depth(), {56, 56, 31.5f, 23.5f, kFusedCols, kFusedRows}, 0.3f, 2.0f, 1.8f,
        kFusedTruncationM};
    const VisibleGroupPass visible{map.view(),   geometry,  ranges_.view(), T_cam_map,
                                   {-4, -4, -1}, {8, 8, 6}, free_space};
    std::vector<VisibleBlock> list;
    for (uint32_t g = 0; g < 8 * 8 * 6; ++g) {
      const GroupView view = best_loops().visible_group(visible, g);
      for (int32_t bit = 0; bit < kGroupBlocks; ++bit) {
        if (!((view.free | view.mixed) >> bit & 1)) continue;
        const Int3 at = visible.block_at(g, bit);
        ASSERT_NE(map.block(at), nullptr);
        list.push_back({map.view().voxels_of(at) | (view.free >> bit & 1 ? VisibleBlock::kFree : 0u)});
      }
    }
    const IntegratePass pass{
        map.view(), geometry, colour.view().data, T_cam_map, {32767.0f / kFusedTruncationM, kCap},
        free_space, frame_++};
    best_loops().integrate(pass, {list.data(), static_cast<uint32_t>(list.size())});
  }
  void paint(int32_t row0, int32_t row1, int32_t col0, int32_t col1, float z_m, uint8_t masked) {
    for (int32_t r = row0; r < row1; ++r)
      for (int32_t c = col0; c < col1; ++c) {
        depth_m.view().at(r, c) = z_m;
        mask.view().at(r, c) = masked;
        if (masked) colour.view().at(r, c) = {static_cast<uint16_t>(r * c), 1, static_cast<uint8_t>(c)};
      }
  }
  float sdf_m(Vec3 p) {
    BlockCache cache;
    float value = NAN;
    sample_sdf(map.view(), p, cache, value);
    return value;
  }

  AnalyticMap map{12000, kFusedVoxelM, kFusedTruncationM};
  TestImage<float> depth_m;
  TestImage<uint8_t> mask;
  TestImage<LumaChroma> colour;
  bool free_space = true;

 private:
  RangePyramid ranges_;
  int32_t frame_ = 0;
};

/// Every byte of two maps: same blocks with the same ids, voxels and flags.
bool same_maps(Mapper& a, Mapper& b) {
  const VolumeView x = a.map.view(), y = b.map.view();
  const uint32_t used = a.map.used_blocks();
  return used == b.map.used_blocks() &&
         std::memcmp(x.blocks.data, y.blocks.data, used * sizeof(VoxelBlock)) == 0 &&
         std::memcmp(x.block_keys.data, y.block_keys.data, used * sizeof(BlockKey)) == 0 &&
         std::memcmp(x.settled_free.data, y.settled_free.data, used) == 0;
}

TEST(IntegratePass, MaskedPixelsChangeNothing) {
  Mapper one, other, unmasked;
  for (Mapper* m : {&one, &other, &unmasked})
    for (int n = 0; n < 3; ++n) m->integrate();
  const uint32_t blocks_before = one.map.used_blocks();
  for (int n = 0; n < 4; ++n) {
    // The same pixels are masked; what is there differs in depth, colour and motion.
    one.paint(10, 34, 20, 44, 0.9f + 0.01f * static_cast<float>(n), 255);
    other.paint(10, 34, 20, 44, n % 2 ? 1.9f : 0.0f, 255);
    unmasked.paint(10, 34, 20, 44, 0.9f, 0);
    for (Mapper* m : {&one, &other, &unmasked}) m->integrate();
  }
  EXPECT_TRUE(same_maps(one, other));
  EXPECT_FALSE(same_maps(one, unmasked));
  EXPECT_EQ(one.map.used_blocks(), blocks_before);  // nothing was made for them
}

TEST(IntegratePass, VoxelsUnderMaskedPixelsKeepEveryByte) {
  Mapper m;
  m.integrate();
  const uint32_t used = m.map.used_blocks();
  std::vector<VoxelBlock> before(m.map.view().blocks.data, m.map.view().blocks.data + used);
  m.paint(0, kFusedRows, 0, kFusedCols, 1.0f, 255);
  m.integrate();
  EXPECT_EQ(m.map.used_blocks(), used);
  EXPECT_EQ(std::memcmp(before.data(), m.map.view().blocks.data, used * sizeof(VoxelBlock)), 0);
}

TEST(IntegratePass, FillsDistanceColourAndFreeSpace) {
  Mapper m;
  m.integrate();
  EXPECT_NEAR(m.sdf_m({0, 0, 1.5f}), 0.0f, 1e-3f);
  EXPECT_NEAR(m.sdf_m({0.1f, -0.1f, 1.45f}), 0.05f, 1e-3f);
  EXPECT_NEAR(m.sdf_m({0, 0, 1.55f}), -0.05f, 1e-3f);
  EXPECT_FLOAT_EQ(m.sdf_m({0, 0, 1.0f}), kFusedTruncationM);
  EXPECT_TRUE(std::isnan(m.sdf_m({0, 0, 1.7f})));     // hidden
  EXPECT_TRUE(std::isnan(m.sdf_m({0, 0, 0.2f})));     // too near to be seen
  EXPECT_TRUE(std::isnan(m.sdf_m({1.5f, 0, 1.0f})));  // outside of the view
  const VoxelRecord& record = m.map.record({0, 0, 75});
  EXPECT_EQ(record.weight, 1);
  EXPECT_EQ(record.colour_weight, 1);
  EXPECT_EQ(record.cb, 4 * 32);  // the optical axis goes between pixels 31 and 32
  EXPECT_EQ(record.cr, 140);
  EXPECT_EQ(m.map.record({0, 0, 50}).colour_weight, 0);
}

TEST(IntegratePass, HiddenVoxelsStayAsTheyAre) {
  Mapper m;
  m.integrate();
  const float behind_m = m.sdf_m({0, 0, 1.5f});
  m.paint(0, kFusedRows, 0, kFusedCols, 1.0f, 0);  // something stands before the wall
  for (int n = 0; n < 20; ++n) m.integrate();
  EXPECT_EQ(m.sdf_m({0, 0, 1.5f}), behind_m);
  EXPECT_EQ(m.map.record({0, 0, 75}).weight, 1);
}

TEST(IntegratePass, WhatIsSeenThroughIsCarved) {
  Mapper m;
  m.paint(0, kFusedRows, 0, kFusedCols, 1.0f, 0);
  for (int n = 0; n < 8; ++n) m.integrate();
  EXPECT_NEAR(m.sdf_m({0, 0, 1.0f}), 0.0f, 1e-3f);
  m.paint(0, kFusedRows, 0, kFusedCols, 1.5f, 0);
  for (int n = 0; n < kCarveFrames; ++n) m.integrate();
  for (float z_m = 0.5f; z_m < 1.4f; z_m += 0.02f) EXPECT_EQ(m.sdf_m({0, 0, z_m}), kFusedTruncationM) << z_m;
  EXPECT_NEAR(m.sdf_m({0, 0, 1.5f}), 0.0f, 1e-3f);
}

TEST(IntegratePass, TooFarAMeasurementMakesFreeSpaceAndNoSurface) {
  Mapper m;
  m.paint(0, kFusedRows, 0, kFusedCols, 3.0f, 0);  // max_m is 2, the clipping plane 1.8
  m.integrate();
  EXPECT_GT(m.map.used_blocks(), 100u);
  EXPECT_FLOAT_EQ(m.sdf_m({0, 0, 1.75f}), kFusedTruncationM);
  EXPECT_TRUE(std::isnan(m.sdf_m({0, 0, 1.81f})));
  for (uint32_t b = 0; b < m.map.used_blocks(); ++b)
    for (const VoxelSurface& v : m.map.view().blocks[b].surface)
      ASSERT_TRUE(v.sdf == kSdfMax || v.sdf == kSdfUnobserved);
}

TEST(IntegratePass, WithoutFreeSpaceOnlyTheBandIsMapped) {
  Mapper dense, band;
  band.free_space = false;
  dense.integrate();
  band.integrate();
  EXPECT_LT(2 * band.map.used_blocks(), dense.map.used_blocks());
  EXPECT_EQ(band.sdf_m({0, 0, 1.5f}), dense.sdf_m({0, 0, 1.5f}));
  EXPECT_TRUE(std::isnan(band.sdf_m({0, 0, 1.0f})));
  band.paint(0, kFusedRows, 0, kFusedCols, 1.9f, 0);  // what was in the band is carved all the same
  for (int n = 0; n < kCarveFrames; ++n) band.integrate();
  EXPECT_EQ(band.sdf_m({0, 0, 1.5f}), kFusedTruncationM);
}

TEST(IntegratePass, ABlockThatIsLongFreeSettlesAndWakesWhenASurfaceComes) {
  Mapper m;
  const VolumeView view = m.map.view();
  const auto settled = [&] {
    const BlockId id = view.voxels_of({0, 0, 6});  // z from 0.96 to 1.1 m
    EXPECT_NE(id, kNoBlock);
    return view.settled_free[id];
  };
  for (int n = 1; n <= 4; ++n) {
    EXPECT_TRUE(n == 1 || settled() == 0);
    m.integrate();
  }
  EXPECT_EQ(settled(), 1);  // as many as the weight cap
  m.integrate();
  EXPECT_EQ(settled(), 1);
  m.paint(0, kFusedRows, 0, kFusedCols, 1.05f, 0);
  m.integrate();
  EXPECT_EQ(settled(), 0);
  EXPECT_LT(m.sdf_m({0.04f, 0.04f, 1.05f}), kFusedTruncationM);
  m.paint(0, kFusedRows, 0, kFusedCols, 1.5f, 0);
  for (int n = 0; n < kCarveFrames; ++n) m.integrate();
  EXPECT_EQ(settled(), 1);
  EXPECT_EQ(m.sdf_m({0.04f, 0.04f, 1.05f}), kFusedTruncationM);
}

/// Blocks around the optical axis with every kind of voxel.
void fill_at_random(AnalyticMap& map, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int32_t> sdf(-32767, 32767), luma(0, 65280), byte(0, 255), kind(0, 3),
      cap(1, 8);
  for (int32_t z = 2; z < 10; ++z)
    for (int32_t y = -3; y < 3; ++y)
      for (int32_t x = -3; x < 3; ++x) {
        VoxelBlock& block = *map.block({x, y, z});
        for (int32_t i = 0; i < kBlockVoxels; ++i) {
          const int32_t k = kind(random);
          if (k == 0) continue;  // unobserved
          block.surface[i] = {k == 1 ? kSdfMax : static_cast<int16_t>(sdf(random)),
                              static_cast<uint16_t>(luma(random))};
          block.record[i] = {static_cast<uint8_t>(cap(random)),
                             static_cast<uint8_t>(k == 1 ? 0 : cap(random)),
                             static_cast<uint8_t>(byte(random)), static_cast<uint8_t>(byte(random))};
        }
      }
}

TEST(IntegratePass, PlainVoxelsEqualRowsOfEight) {
  TestImage<float> depth(kFusedRows, kFusedCols);
  TestImage<LumaChroma> colour(kFusedRows, kFusedCols);
  std::mt19937 random(31);
  std::uniform_real_distribution<float> z(0.4f, 2.4f);
  std::uniform_int_distribution<int32_t> luma(0, 65280), byte(0, 255);
  std::bernoulli_distribution hole(0.1);
  for (int32_t r = 0; r < kFusedRows; ++r)
    for (int32_t c = 0; c < kFusedCols; ++c) {
      depth.view().at(r, c) = hole(random) ? 0.0f : z(random);
      colour.view().at(r, c) = {static_cast<uint16_t>(luma(random)), static_cast<uint8_t>(byte(random)),
                                static_cast<uint8_t>(byte(random))};
    }
  for (const CpuLoops* loops : runnable_loops())
    for (const bool free_space : {true, false}) {
      AnalyticMap plain(400, kFusedVoxelM, kFusedTruncationM), rows(400, kFusedVoxelM, kFusedTruncationM);
      fill_at_random(plain, 5);
      fill_at_random(rows, 5);
      const FrameGeometry geometry{
          depth.view(), {56, 56, 31.5f, 23.5f, kFusedCols, kFusedRows}, 0.3f, 2.0f, 1.8f, kFusedTruncationM};
      const Se3 T_cam_map = exp(Twist{{0.02f, -0.03f, 0.01f}, {0.05f, 0.1f, -0.2f}});
      IntegratePass pass{
          plain.view(), geometry, colour.view().data, T_cam_map, {32767.0f / kFusedTruncationM, kCap},
          free_space,   41};
      std::vector<VisibleBlock> list;
      for (uint32_t id = 0; id < plain.used_blocks(); ++id)
        list.push_back({id | (id % 5 ? 0u : VisibleBlock::kFree)});
      for (const VisibleBlock block : list) pass(block, PlainVoxels{});
      pass.map = rows.view();
      loops->integrate(pass, {list.data(), static_cast<uint32_t>(list.size())});
      // A fused multiply-add may move a voxel that projects onto the border of two pixels.
      int32_t different = 0, changed = 0;
      AnalyticMap untouched(400, kFusedVoxelM, kFusedTruncationM);
      fill_at_random(untouched, 5);
      for (uint32_t id = 0; id < plain.used_blocks(); ++id) {
        EXPECT_EQ(plain.view().settled_free[id], rows.view().settled_free[id]);
        for (int32_t i = 0; i < kBlockVoxels; ++i) {
          const VoxelSurface a = plain.view().blocks[id].surface[i], b = rows.view().blocks[id].surface[i];
          const VoxelRecord c = plain.view().blocks[id].record[i], d = rows.view().blocks[id].record[i];
          different += std::abs(a.sdf - b.sdf) > 1 || std::abs(a.luma - b.luma) > 1 || c.weight != d.weight ||
                       c.colour_weight != d.colour_weight || std::abs(c.cb - d.cb) > 1 ||
                       std::abs(c.cr - d.cr) > 1;
          changed += a.sdf != untouched.view().blocks[id].surface[i].sdf;
        }
      }
      EXPECT_LE(different, 15) << loops->name;
      EXPECT_GT(changed, 20000);
    }
}

}  // namespace
}  // namespace stillmap
