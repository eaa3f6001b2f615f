#include "kernels/track/track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "kernels/backend/cpu/loops.hpp"
#include "tests/support/corner_scene.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::corner_map;
using test::CornerScene;
using test::CornerView;
using test::TestImage;

constexpr float kVoxelM = 0.02f, kTruncationM = 0.1f;

TrackWeights weights_of(const TrackParams& p) {
  return {kTruncationM / static_cast<float>(kSdfMax),
          1.0f / kVoxelM,
          p.colour_weight,
          p.inlier_m,
          RobustKernel::huber,
          p.huber_depth_m > 0 ? p.huber_depth_m : 1e9f};
}

TrackPass pass_of(AnalyticMap& map, const CornerView& view, const Se3& T_map_cam, const TrackParams& params) {
  TrackPass pass;
  pass.map = map.view();
  pass.depth_m = view.image(view.depth_m);
  pass.colour = view.image(view.luma);
  pass.k = view.k;
  pass.T_map_cam = T_map_cam;
  pass.max_m = 5.0f;
  pass.weights = weights_of(params);
  return pass;
}

/// KeptCorners with its memory; nothing is kept yet.
class Kept {
 public:
  explicit Kept(const Intrinsics& k)
      : cell_(k.height, k.width), corners_(k.height, k.width), view{cell_.view(), corners_.view(), 1} {
    view.forget_rows(0, k.height);
  }

 private:
  TestImage<uint64_t> cell_;
  TestImage<KeptCorners::Corners> corners_;

 public:
  const KeptCorners view;
};

/// register_frame over one of the loop tables, tiles of 16 rows.
TrackResult registered(TrackPass pass, const Se3& T_start, const TrackParams& params,
                       int32_t min_points = 100) {
  const Kept kept(pass.k);
  struct Context {
    TrackPass& pass;
    const KeptCorners& kept;
  } context{pass, kept.view};
  const PassRunner runner{[](void* opaque, const Se3& T_map_cam, int32_t step) {
                            const auto& [p, corners] = *static_cast<Context*>(opaque);
                            p.T_map_cam = T_map_cam;
                            NormalEq sums;
                            for (int32_t r = 0; r < p.k.height; r += 16)
                              sums.add(best_loops().track(p, corners, r, std::min(r + 16, p.k.height), step));
                            return sums;
                          },
                          &context};
  return register_frame(runner, T_start, params, {params.levels - 1, 0}, min_points);
}

struct PoseError {
  double translation_m, rotation_rad;
};
PoseError error_of(const Se3& estimate, const Se3d& truth) {
  const Se3d off = inverse(truth) * cast<double>(estimate);
  return {norm(off.translation), norm(log_rotation(off.rotation))};
}
bool finite(const Se3& T) {
  for (const float x : T.rotation.m)
    if (!std::isfinite(x)) return false;
  return std::isfinite(norm(T.translation));
}
void expect_same_pose(const Se3& a, const Se3& b) {
  for (int i = 0; i < 9; ++i) EXPECT_EQ(a.rotation.m[i], b.rotation.m[i]);
  EXPECT_EQ(norm(a.translation - b.translation), 0.0f);
}
Vec3d random_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return normalized(Vec3d{normal(random), normal(random), normal(random)});
}

// --- one point ---

TrackPoint<float> random_point(std::mt19937& random) {
  std::uniform_real_distribution<float> sdf(-9000, 9000), luma(0, 65280), inside(0.1f, 0.9f), arm(-2, 2);
  TrackPoint<float> point;
  for (float& x : point.sdf) x = std::round(sdf(random));
  for (float& x : point.luma) x = std::round(luma(random));
  point.surface = true;
  point.fraction = {inside(random), inside(random), inside(random)};
  point.arm = {arm(random), arm(random), arm(random)};
  point.measured_luma = luma(random);
  return point;
}

// A trilinear function is linear along each axis: differences over any step inside the cell are exact.
TEST(PointTerms, GradientsEqualFiniteDifferences) {
  const TrackWeights w = weights_of({});
  std::mt19937 random(1);
  for (int n = 0; n < 500; ++n) {
    const TrackPoint<float> point = random_point(random);
    const PointTerms<float> t = point_terms(point, w);
    for (int axis = 0; axis < 3; ++axis) {
      const auto moved = [&](float by) {
        TrackPoint<float> p = point;
        (axis == 0 ? p.fraction.x : axis == 1 ? p.fraction.y : p.fraction.z) += by;
        return point_terms(p, w);
      };
      const PointTerms<float> plus = moved(0.1f), minus = moved(-0.1f);
      const float step_m = 0.2f * kVoxelM;
      const auto along = [&](Vec3 g) { return axis == 0 ? g.x : axis == 1 ? g.y : g.z; };
      EXPECT_NEAR(along(t.depth_gradient), (plus.depth_residual_m - minus.depth_residual_m) / step_m, 1e-3f);
      EXPECT_NEAR(along(t.colour_gradient), (plus.colour_residual - minus.colour_residual) / step_m, 5e-3f);
    }
  }
}

TEST(PointTerms, ResidualsWeightsAndCostAreTheEquations) {
  TrackWeights w = weights_of({});
  w.colour_weight = 0.025f;
  TrackPoint<float> p;
  const float unit_m = w.sdf_unit_m;
  const auto at = [&](float sdf_m, float luma, float measured) {
    for (int i = 0; i < 8; ++i) p.sdf[i] = sdf_m / unit_m, p.luma[i] = luma * kLumaScale;
    p.surface = true;
    p.fraction = {0.3f, 0.6f, 0.2f};
    p.measured_luma = measured * kLumaScale;
    return point_terms(p, w);
  };
  PointTerms<float> t = at(0.01f, 0.75f, 0.5f);  // within Huber's threshold of 0.02 m
  EXPECT_NEAR(t.depth_residual_m, 0.01f, 1e-6f);
  EXPECT_NEAR(t.colour_residual, 0.25f, 1e-6f);
  EXPECT_EQ(t.depth_weight, 1.0f);
  EXPECT_EQ(t.colour_weight, 0.025f);
  EXPECT_NEAR(t.cost, 0.01f * 0.01f + 0.025f * 0.25f * 0.25f, 1e-7f);
  EXPECT_EQ(t.inlier, 1.0f);
  t = at(-0.05f, 0.5f, 0.5f);
  EXPECT_NEAR(t.depth_weight, 0.02f / 0.05f, 1e-5f);
  EXPECT_NEAR(t.cost, 0.02f * (2 * 0.05f - 0.02f), 1e-6f);
  EXPECT_EQ(t.inlier, 0.0f);
  w.kernel_m = 1e9f;  // squared error everywhere
  t = at(-0.05f, 0.5f, 0.5f);
  EXPECT_EQ(t.depth_weight, 1.0f);
  EXPECT_NEAR(t.cost, 0.0025f, 1e-7f);
  p.surface = false;  // a voxel at the truncation distance: the point counts, but gives no direction
  t = point_terms(p, w);
  EXPECT_EQ(t.depth_weight, 0.0f);
  EXPECT_EQ(t.colour_weight, 0.0f);
}

// --- one pass over an image ---

class TrackTest : public testing::Test {
 protected:
  CornerScene scene_;
  AnalyticMap map_ = corner_map(scene_, kVoxelM, kTruncationM);
  Se3d T_truth_ = exp(Twistd{{-0.15, -0.1, 0.05}, {0.05, -0.08, 0.1}});
  TrackParams params_;
};

TEST_F(TrackTest, GradientOfTheSumsIsThatOfTheCost) {
  params_.huber_depth_m = 0;
  const CornerView view(scene_, corner_camera(80), T_truth_);
  // 1 cm and half a degree off, and the increment turns about the camera centre.
  const Se3d T = T_truth_ * exp(Twistd{{0.008, -0.005, 0.006}, {0.004, 0.006, -0.005}});
  const auto sums_at = [&](const Twistd& xi) {
    const Se3d moved = {exp(Twistd{{}, xi.w}).rotation * T.rotation, T.translation + xi.v};
    const TrackPass pass = pass_of(map_, view, cast<float>(moved), params_);
    NormalEq sums;
    for (int32_t r = 0; r < view.k.height; ++r) {
      NormalEqT<float> row;
      BlockCache cache;
      for (int32_t c = 0; c < view.k.width; ++c) pass(r, c, cache, row);
      sums.add(row);
    }
    return sums;
  };
  const NormalEq here = sums_at({});
  for (int axis = 0; axis < 6; ++axis) {
    constexpr double kStep = 2e-4;
    double along[6] = {};
    along[axis] = kStep;
    const Twistd plus = {{along[0], along[1], along[2]}, {along[3], along[4], along[5]}};
    const NormalEq a = sums_at(plus), b = sums_at({-plus.v, -plus.w});
    ASSERT_EQ(a.sum[kPoints], b.sum[kPoints]);
    const double slope = (a.sum[kCost] - b.sum[kCost]) / (2 * kStep);
    // J^T W r is half of the slope of r^T W r.
    EXPECT_NEAR(here.sum[kGradient + axis], 0.5 * slope, 0.02 * std::fabs(0.5 * slope) + 0.05) << axis;
  }
}

TEST_F(TrackTest, PlainPassEqualsTheVectorLoops) {
  CornerView view(scene_, corner_camera(160), T_truth_);
  std::mt19937 random(12);
  std::bernoulli_distribution hole(0.1), masked(0.2);
  std::normal_distribution<float> noise(0, 0.02f);
  std::vector<uint8_t> trust(view.depth_m.size());
  for (size_t i = 0; i < trust.size(); ++i) {
    view.depth_m[i] = hole(random) ? 0.0f : view.depth_m[i] + noise(random);
    trust[i] = static_cast<uint8_t>(masked(random) ? 0 : 100 + i % 156);
  }
  TrackPass pass = pass_of(map_, view, cast<float>(T_truth_), params_);
  pass.max_m = 2.1f;  // some are too far
  pass.weights.kernel_per_range2 = 0.003f;
  for (const bool use_trust : {false, true})
    for (const int32_t step : {1, 2, 4})
      for (const CpuLoops* loops : runnable_loops()) {
        pass.trust = use_trust ? view.image(trust) : ImageView<const uint8_t>{};
        pass.weights.kernel = use_trust ? RobustKernel::geman_mcclure : RobustKernel::huber;
        NormalEqT<float> plain;
        BlockCache cache;
        for (int32_t r = 32; r < 64; r += step)
          for (int32_t c = 0; c < 160; c += step) pass(r, c, cache, plain);
        const Kept kept(view.k);
        const NormalEqT<float> vector = loops->track(pass, kept.view, 32, 64, step);
        EXPECT_EQ(plain.sum[kConsidered], vector.sum[kConsidered]);
        EXPECT_NEAR(plain.sum[kPoints], vector.sum[kPoints], 2);
        EXPECT_NEAR(plain.sum[kInliers], vector.sum[kInliers], 2);
        EXPECT_GT(plain.sum[kPoints], 200.0f);
        int k = 0;
        float diagonal[6];
        for (int r = 0; r < 6; ++r) {
          diagonal[r] = plain.sum[k];
          k += 6 - r;
        }
        k = 0;
        for (int r = 0; r < 6; ++r)
          for (int c = r; c < 6; ++c, ++k)
            EXPECT_NEAR(plain.sum[k], vector.sum[k], 2e-3f * std::sqrt(diagonal[r] * diagonal[c]))
                << loops->name << " step " << step;
        for (int r = 0; r < 6; ++r)
          EXPECT_NEAR(plain.sum[kGradient + r], vector.sum[kGradient + r], 2e-3f * std::sqrt(diagonal[r]));
        EXPECT_NEAR(plain.sum[kWeight], vector.sum[kWeight], 2.0f);
        EXPECT_EQ(use_trust, plain.sum[kWeight] < 0.9f * plain.sum[kPoints]);
        EXPECT_NEAR(plain.sum[kCost], vector.sum[kCost], 2e-3f * plain.sum[kCost]);
        EXPECT_NEAR(plain.sum[kSumSdf2], vector.sum[kSumSdf2], 2e-3f * plain.sum[kSumSdf2]);
      }
}

TEST_F(TrackTest, UntrustedInvalidAndFarPixelsAreNotConsidered) {
  CornerView view(scene_, corner_camera(32), T_truth_);
  std::vector<uint8_t> trust(view.depth_m.size(), 0);
  trust[5] = trust[6] = trust[7] = trust[8] = trust[9] = 255;
  view.depth_m[6] = 0.0f;
  view.depth_m[7] = std::numeric_limits<float>::quiet_NaN();
  view.depth_m[8] = std::numeric_limits<float>::infinity();
  TrackPass pass = pass_of(map_, view, cast<float>(T_truth_), params_);
  pass.trust = view.image(trust);
  const NormalEqT<float> sums = best_loops().track(pass, Kept(view.k).view, 0, view.k.height, 1);
  EXPECT_EQ(sums.sum[kConsidered], 2.0f);
  for (const float x : sums.sum) EXPECT_TRUE(std::isfinite(x));
}

TEST_F(TrackTest, WhatIsKeptFromOtherPosesChangesNothing) {
  CornerView view(scene_, corner_camera(160), T_truth_);
  for (size_t i = 0; i < view.depth_m.size(); i += 7)
    view.depth_m[i] += 0.3f;  // some where nothing is mapped
  TrackPass pass = pass_of(map_, view, cast<float>(T_truth_), params_);
  for (const CpuLoops* loops : runnable_loops()) {
    const Kept kept(view.k);
    // Coarse to fine, as a registration goes; at the end back to a pose that was there before.
    const std::pair<int32_t, float> passes[] = {{4, 0.012f}, {4, 0.004f}, {2, 0.002f},
                                                {1, 0.001f}, {1, 0.0f},   {1, 0.0f}};
    for (const auto& [step, off_m] : passes) {
      pass.T_map_cam = cast<float>(T_truth_);
      pass.T_map_cam.translation.x += off_m;
      const NormalEqT<float> with = loops->track(pass, kept.view, 0, view.k.height, step),
                             without = loops->track(pass, Kept(view.k).view, 0, view.k.height, step);
      for (int32_t t = 0; t < kTerms; ++t)
        EXPECT_EQ(with.sum[t], without.sum[t]) << loops->name << " term " << t;
      EXPECT_GT(with.sum[kPoints], 100.0f);
    }
  }
}

TEST_F(TrackTest, WhatIsKeptIsOfTheMapAsItWas) {
  const CornerView view(scene_, corner_camera(160), T_truth_);
  const TrackPass pass = pass_of(map_, view, cast<float>(T_truth_), params_);
  const Kept kept(view.k);
  const float before = best_loops().track(pass, kept.view, 0, view.k.height, 1).sum[kSumSdf2];
  for (uint32_t id = 0; id < map_.used_blocks(); ++id)
    for (VoxelSurface& v : map_.view().blocks[id].surface) v.sdf = static_cast<int16_t>(v.sdf / 2);
  EXPECT_EQ(best_loops().track(pass, kept.view, 0, view.k.height, 1).sum[kSumSdf2], before);
  kept.view.forget_rows(0, view.k.height);
  EXPECT_NE(best_loops().track(pass, kept.view, 0, view.k.height, 1).sum[kSumSdf2], before);
}

// --- the registration ---

TEST_F(TrackTest, FindsAKnownPoseAgain) {
  const CornerView view(scene_, corner_camera(160), T_truth_);
  std::mt19937 random(3);
  for (int n = 0; n < 12; ++n) {
    const Twistd off = {0.02 * random_direction(random), 1.5 * M_PI / 180 * random_direction(random)};
    const Se3 T_start = cast<float>(T_truth_ * exp(off));
    const TrackResult result = registered(pass_of(map_, view, T_start, params_), T_start, params_);
    EXPECT_EQ(result.status, Status::ok);
    const PoseError e = error_of(result.T_world_cam, T_truth_);
    EXPECT_LT(e.translation_m, 1e-3) << n;
    EXPECT_LT(e.rotation_rad, 0.05 * M_PI / 180) << n;
    EXPECT_GT(result.inlier_ratio, 0.98f);
    EXPECT_GT(result.mapped_ratio, 0.9f);
    EXPECT_LT(result.rmse_m, 2e-3f);
    EXPECT_LE(result.iterations, 11);
  }
}

// On a single wall depth cannot tell how far the camera slid along it: intensity does.
TEST_F(TrackTest, TextureHoldsWhatDepthLeavesFree) {
  CornerScene wall;
  wall.wall_x = wall.floor_y = 50;
  AnalyticMap map = corner_map(wall, kVoxelM, kTruncationM);
  const CornerView view(wall, corner_camera(160), T_truth_);
  const Se3 T_start = cast<float>(T_truth_ * exp(Twistd{{0.02, -0.01, 0}, {}}));
  params_.iterations_coarse = 30;
  const TrackResult result = registered(pass_of(map, view, T_start, params_), T_start, params_);
  EXPECT_LT(error_of(result.T_world_cam, T_truth_).translation_m, 2e-3);
}

TEST_F(TrackTest, ABareWallGivesAFinitePoseAtTheRightDistance) {
  CornerScene wall;
  wall.wall_x = wall.floor_y = 50;
  wall.textured = false;
  AnalyticMap map = corner_map(wall, kVoxelM, kTruncationM);
  const CornerView view(wall, corner_camera(160), T_truth_);
  const Se3 T_start = cast<float>(T_truth_ * exp(Twistd{{0.005, 0, 0.02}, {0.005, 0, 0}}));
  const TrackResult result = registered(pass_of(map, view, T_start, params_), T_start, params_);
  ASSERT_TRUE(finite(result.T_world_cam));
  if (result.status == Status::degenerate) {
    expect_same_pose(result.T_world_cam, T_start);
    return;
  }
  const Se3d T = cast<double>(result.T_world_cam);
  EXPECT_NEAR(T.translation.z, T_truth_.translation.z, 1e-3);             // the wall's normal is z
  EXPECT_NEAR(T.rotation(2, 2), T_truth_.rotation(2, 2), 1e-4);           // so the tilt is known as well
  EXPECT_LT(error_of(result.T_world_cam, T_truth_).translation_m, 0.03);  // damping keeps the rest near
  EXPECT_GT(result.covariance[0], 100 * result.covariance[11]);           // sliding in x is unsure, z is not
}

TEST_F(TrackTest, TooFewPointsLeaveThePose) {
  const CornerView view(scene_, corner_camera(32), T_truth_);
  const Se3 T_start = cast<float>(T_truth_ * exp(Twistd{{0.01, 0, 0}, {}}));
  const TrackPass pass = pass_of(map_, view, T_start, params_);
  const TrackResult result = registered(pass, T_start, params_, 32 * 24 + 1);
  EXPECT_EQ(result.status, Status::degenerate);
  EXPECT_FALSE(result.converged);
  expect_same_pose(result.T_world_cam, T_start);
  EXPECT_EQ(registered(pass, T_start, params_, 100).status, Status::ok);
}

TEST_F(TrackTest, AnEmptyMapAndPosesThatAreNoNumbersAreDegenerate) {
  const CornerView view(scene_, corner_camera(32), T_truth_);
  AnalyticMap empty(4, kVoxelM, kTruncationM);
  const TrackResult nothing = registered(pass_of(empty, view, {}, params_), {}, params_, 1);
  EXPECT_EQ(nothing.status, Status::degenerate);
  EXPECT_EQ(nothing.mapped_ratio, 0.0f);
  expect_same_pose(nothing.T_world_cam, {});
  Se3 far_away;
  far_away.translation = {1e6f, -1e6f, 1e6f};
  EXPECT_EQ(registered(pass_of(map_, view, far_away, params_), far_away, params_, 1).status,
            Status::degenerate);
}

/// How fast the distance to the surface shrinks along each pixel's depth.
std::vector<float> slopes(const CornerScene& scene, const CornerView& view, const Se3d& T_map_cam) {
  std::vector<float> slope;
  for (int32_t r = 0; r < view.k.height; ++r)
    for (int32_t c = 0; c < view.k.width; ++c) {
      const float z_m = view.depth_m[slope.size()];
      const auto distance_m = [&](float at_m) {
        const Vec3 p = unproject(view.k, static_cast<float>(c), static_cast<float>(r), at_m);
        return scene.sdf_m(
            T_map_cam * Vec3d{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
      };
      slope.push_back(static_cast<float>((distance_m(z_m - 0.1f) - distance_m(z_m)) / 0.1));
    }
  return slope;
}

// With the same noise in every distance, the error's spread is what the covariance says (left perturbation
// about the map's origin).
TEST_F(TrackTest, CovarianceIsTheSpreadOfTheError) {
  params_.colour_weight = 0;
  params_.huber_depth_m = 0;
  const CornerView clean(scene_, corner_camera(64), T_truth_);
  const std::vector<float> slope = slopes(scene_, clean, T_truth_);
  std::mt19937 random(8);
  std::normal_distribution<float> noise(0, 0.005f);
  constexpr int kTrials = 60;
  double spread[6] = {}, said[6] = {};
  for (int n = 0; n < kTrials; ++n) {
    CornerView view = clean;
    for (size_t i = 0; i < slope.size(); ++i) view.depth_m[i] += noise(random) / std::max(slope[i], 0.1f);
    const Se3 T_start = cast<float>(T_truth_);
    const TrackResult result = registered(pass_of(map_, view, T_start, params_), T_start, params_);
    ASSERT_EQ(result.status, Status::ok);
    const Se3d T = cast<double>(result.T_world_cam);
    const Vec3d w = log_rotation(T.rotation * transposed(T_truth_.rotation));
    const Vec3d v = T.translation - T_truth_.translation - cross(w, T_truth_.translation);
    const double off[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
    const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    for (int i = 0; i < 6; ++i) {
      spread[i] += off[i] * off[i] / kTrials;
      said[i] += static_cast<double>(result.covariance[diagonal[i]]) / kTrials;
    }
  }
  for (int i = 0; i < 6; ++i) {
    EXPECT_GT(said[i], 0);
    EXPECT_GT(said[i], 0.4 * spread[i]) << i;
    EXPECT_LT(said[i], 2.5 * spread[i]) << i;
  }
}

// --- accept and reject, with costs as scripted ---

/// Answers with the next mean cost of a script; the gradient always asks for a step of `step_m` along -x.
struct Script {
  std::vector<double> mean_cost;
  std::vector<double> points = {};  ///< empty: 1000 each
  double step_m = 0.01;
  std::vector<Se3> asked = {};

  TrackResult run(const TrackParams& params, const Se3& T_start = {}, int32_t min_points = 10,
                  const PosePrior& prior = {}) {
    const PassRunner runner{[](void* context, const Se3& T_map_cam, int32_t) {
                              return static_cast<Script*>(context)->answer(T_map_cam);
                            },
                            this};
    return register_frame(runner, T_start, params, {params.levels - 1, 0}, min_points, prior);
  }
  NormalEq answer(const Se3& T_map_cam) {
    const size_t call = asked.size();
    asked.push_back(T_map_cam);
    NormalEq sums;
    int k = 0;
    for (int r = 0; r < 6; ++r) {
      sums.sum[k] = 1;
      k += 6 - r;
    }
    sums.sum[kGradient] = step_m;
    sums.sum[kPoints] = points.empty() ? 1000 : points.at(call);
    sums.sum[kCost] = mean_cost.at(call) * sums.sum[kPoints];
    sums.sum[kInliers] = sums.sum[kConsidered] = sums.sum[kWeight] = sums.sum[kPoints];
    sums.sum[kSumSdf2] = 4 * sums.sum[kInliers];
    return sums;
  }
};

TrackParams one_level(int32_t iterations) {
  TrackParams p;
  p.levels = 1;
  p.iterations_fine = iterations;
  return p;
}

TEST(RegisterFrame, APriorHoldsThePoseAsFarAsItIsWorth) {
  TrackParams params = one_level(1);
  params.damping_initial = 0;
  params.prior_point_m = 1.0f;  // information counts as it is
  const auto moved_m = [&](float information) {
    Script script{{1.0, 0.5}};
    PosePrior prior;
    prior.information[0] = information;  // of x
    return -script.run(params, {}, 10, prior).T_world_cam.translation.x;
  };
  EXPECT_NEAR(moved_m(0), 0.01f, 1e-5f);
  EXPECT_NEAR(moved_m(1), 0.005f, 1e-5f);  // the points have a Hessian of 1
  EXPECT_NEAR(moved_m(99), 0.0001f, 1e-6f);
}

TEST(Kernels, HuberKeepsPullingAndGemanMcClureLetsGo) {
  const auto pull = [](Robust<float> r, float size) { return r.weight * size; };
  EXPECT_FLOAT_EQ(huber(0.01f, 0.02f).weight, 1.0f);
  EXPECT_FLOAT_EQ(pull(huber(0.2f, 0.02f), 0.2f), 0.02f);
  EXPECT_NEAR(geman_mcclure(1e-6f, 0.02f).weight, 1.0f, 0.01f);
  EXPECT_LT(pull(geman_mcclure(0.04f, 0.02f), 0.2f), 0.0001f);
  // Half of the slope of the cost is weight times error, for both.
  for (const float e : {0.005f, 0.015f, 0.05f}) {
    const float d = 1e-4f;
    const float slope_h = (huber(e + d, 0.02f).cost - huber(e - d, 0.02f).cost) / (4 * d);
    EXPECT_NEAR(slope_h, pull(huber(e, 0.02f), e), 2e-4f);
    const float slope_g =
        (geman_mcclure((e + d) * (e + d), 0.02f).cost - geman_mcclure((e - d) * (e - d), 0.02f).cost) /
        (4 * d);
    EXPECT_NEAR(slope_g, pull(geman_mcclure(e * e, 0.02f), e), 2e-4f);
  }
}

TEST(RegisterFrame, AcceptsAStepThatLowersTheCost) {
  Script script{{1.0, 0.5}};
  const TrackResult result = script.run(one_level(1));
  EXPECT_EQ(result.status, Status::ok);
  EXPECT_EQ(result.iterations, 1);
  EXPECT_NEAR(result.T_world_cam.translation.x, -0.01f, 1e-4f);
  EXPECT_FALSE(result.converged);
}

TEST(RegisterFrame, AStepThatRaisesTheCostIsNotTakenAndTheNextIsShorter) {
  TrackParams params = one_level(4);
  params.settled_m = 0;  // each is judged
  params.damping_initial = 1.0f;
  params.converged_m = 0;
  Script script{{1.0, 1.1, 2.0, 1.0, 1.5}};  // an equal cost is no gain either
  const TrackResult result = script.run(params);
  EXPECT_EQ(result.iterations, 4);
  expect_same_pose(result.T_world_cam, {});
  ASSERT_EQ(script.asked.size(), 5u);
  for (size_t i = 2; i < 5; ++i)
    EXPECT_LT(std::fabs(script.asked[i].translation.x), 0.5f * std::fabs(script.asked[i - 1].translation.x));
}

TEST(RegisterFrame, AfterAnAcceptedStepDampingFalls) {
  TrackParams params = one_level(2);
  params.damping_initial = 1.0f;
  Script script{{1.0, 0.5, 0.25}};
  const TrackResult result = script.run(params);
  EXPECT_NEAR(script.asked[1].translation.x, -0.01f / 2.0f, 1e-6f);
  EXPECT_NEAR(script.asked[2].translation.x - script.asked[1].translation.x, -0.01f / 1.1f, 1e-6f);
  expect_same_pose(result.T_world_cam, script.asked[2]);
}

TEST(RegisterFrame, AStepThatLeavesTheMapIsNotTaken) {
  Script lost{{1.0, 0.1}, {1000, 790}};
  expect_same_pose(lost.run(one_level(1)).T_world_cam, {});
  Script kept{{1.0, 0.1}, {1000, 810}};
  EXPECT_NE(kept.run(one_level(1)).T_world_cam.translation.x, 0.0f);
}

TEST(RegisterFrame, NothingThatIsNotANumberIsTaken) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Script bad_cost{{1.0, nan, nan}};
  expect_same_pose(bad_cost.run(one_level(2)).T_world_cam, {});
  Script bad_step{{1.0, 0.5}, {}, nan};
  const TrackResult result = bad_step.run(one_level(1));
  EXPECT_EQ(result.iterations, 0);
  expect_same_pose(result.T_world_cam, {});
}

// About the camera centre c the covariance is 4 times the identity here. About the origin the same motion has
// v = v_c + c x w: far from it a little turn is a long way.
TEST(RegisterFrame, CovarianceIsAboutTheOriginOfTheMap) {
  Se3 T_start;
  T_start.translation = {1, 2, 3};
  Script script{{1.0}};
  const TrackResult result = script.run(one_level(0), T_start);
  EXPECT_NEAR(result.rmse_m, 2.0f, 1e-6f);
  const double c[3] = {1, 2, 3};
  const double cross_c[3][3] = {{0, -c[2], c[1]}, {c[2], 0, -c[0]}, {-c[1], c[0], 0}};
  double expected[6][6] = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      expected[i][j] = 4 * (i == j);
      for (int k = 0; k < 3; ++k) expected[i][j] += 4 * cross_c[i][k] * cross_c[j][k];
      expected[i][3 + j] = 4 * cross_c[i][j];
      expected[3 + i][3 + j] = 4 * (i == j);
    }
  int k = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j, ++k)
      EXPECT_NEAR(static_cast<double>(result.covariance[k]), expected[i][j], 1e-5) << i << " " << j;
}

TEST(RegisterFrame, ASmallStepEndsALevel) {
  Script script{{1.0, 0.9, 0.8}, {}, 5e-5};
  const TrackResult result = script.run(one_level(2));
  EXPECT_EQ(result.iterations, 1);
  EXPECT_TRUE(result.converged);
}

// Steps of 1 mm, of which every one is taken for settled.
TEST(RegisterFrame, ASettledStepThatDoesNotLowerTheCostEndsItsLevel) {
  TrackParams params = one_level(5);
  params.damping_initial = 0;
  params.settled_cost = 1e-3f;
  Script a_little_worse{{1.0, 0.5, 0.5004, 0.1}, {}, 1e-3};
  EXPECT_NEAR(a_little_worse.run(params).T_world_cam.translation.x, -2e-3f, 1e-6f);
  EXPECT_EQ(a_little_worse.asked.size(), 3u);
  Script worse{{1.0, 0.5, 0.502, 0.1}, {}, 1e-3};
  EXPECT_NEAR(worse.run(params).T_world_cam.translation.x, -1e-3f, 1e-6f);
  EXPECT_EQ(worse.asked.size(), 3u);
  Script off_the_map{{1.0, 0.5, 0.4, 0.1}, {1000, 1000, 700, 1000}, 1e-3};
  EXPECT_NEAR(off_the_map.run(params).T_world_cam.translation.x, -1e-3f, 1e-6f);
  EXPECT_EQ(off_the_map.asked.size(), 3u);
}

TEST(RegisterFrame, TheLastSettledStepIsTakenWithoutAPass) {
  TrackParams params = one_level(2);
  params.damping_initial = 0;
  Script script{{1.0, 0.5}, {}, 1e-3};
  EXPECT_NEAR(script.run(params).T_world_cam.translation.x, -2e-3f, 1e-6f);
  EXPECT_EQ(script.asked.size(), 2u);
  params.settled_rad = 0;  // off
  Script judged{{1.0, 0.5, 0.6}, {}, 1e-3};
  EXPECT_NEAR(judged.run(params).T_world_cam.translation.x, -1e-3f, 1e-6f);
  EXPECT_EQ(judged.asked.size(), 3u);
}

TEST(RegisterFrame, LevelsGoFromCoarseToFine) {
  std::vector<int32_t> steps;
  const PassRunner runner{[](void* context, const Se3&, int32_t step) {
                            static_cast<std::vector<int32_t>*>(context)->push_back(step);
                            return NormalEq{};
                          },
                          &steps};
  EXPECT_EQ(register_frame(runner, {}, {}, {}, 1).status, Status::degenerate);
  EXPECT_EQ(steps, (std::vector<int32_t>{4, 2, 1}));
}

}  // namespace
}  // namespace stillmap
