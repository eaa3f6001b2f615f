#include "runtime/pipeline/pose_quality.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stillmap {
namespace {

constexpr float kGoodPoseRad = kGoodPoseDeg * 0.017453293f;

/// Entry of a row-by-row upper triangle.
int32_t at(int32_t row, int32_t col) {
  return row * 6 - row * (row - 1) / 2 + col - row;
}

/// A registration that nothing speaks against: a millimetre, a tenth of a degree.
TrackResult registered() {
  TrackResult track;
  track.inlier_ratio = 0.95f;
  for (int32_t i = 0; i < 6; ++i) track.covariance[at(i, i)] = i < 3 ? 1e-6f : 3e-6f;
  return track;
}

TEST(PoseQuality, SigmaIsThatOfTheCameraNotOfTheOrigin) {
  // A camera at x = 10 that can only turn about z, by 0.01 rad: its own place is known.
  const float s2 = 1e-4f;
  float covariance[21] = {};
  covariance[at(5, 5)] = s2;
  covariance[at(1, 5)] = -10 * s2;  // v_origin = centre x w
  covariance[at(1, 1)] = 100 * s2;
  const std::array<float, 6> sigma = sigma_about(covariance, {10, 0, 0});
  for (size_t i = 0; i < 5; ++i) EXPECT_NEAR(sigma[i], 0, 1e-3f) << i;
  EXPECT_NEAR(sigma[5], 0.01f, 1e-6f);
  EXPECT_NEAR(sigma_about(covariance, {})[1], 0.1f, 1e-6f);
}

TEST(PoseQuality, ProbabilityFallsWithSigma) {
  EXPECT_EQ(probability_within({}), 1.0f);
  EXPECT_NEAR(probability_within({kGoodPoseM, 0, 0, 0, 0, 0}), 0.6827f, 1e-3f);
  EXPECT_NEAR(probability_within({0, 0, 0, 0, kGoodPoseRad, 0}), 0.6827f, 1e-3f);
  EXPECT_NEAR(probability_within({0, 0.5f * kGoodPoseM, 0, 0, 0, 0.5f * kGoodPoseRad}), 0.9545f * 0.9545f,
              1e-3f);
}

TEST(PoseQuality, ManyInliersAndATightCovarianceAreGood) {
  const PoseQuality quality = quality_of(registered(), {}, {});
  EXPECT_EQ(quality.state, TrackingState::good);
  EXPECT_GT(quality.p_good, 0.99f);
}

TEST(PoseQuality, FewInliersArePoorAndFewerLost) {
  const TrackParams params;
  TrackResult track = registered();
  track.inlier_ratio = 0.99f * params.poor_inlier_ratio;
  EXPECT_EQ(quality_of(track, {}, params).state, TrackingState::poor);
  EXPECT_LT(quality_of(track, {}, params).p_good, 0.5f);
  track.inlier_ratio = 0.99f * params.lost_inlier_ratio;
  EXPECT_EQ(quality_of(track, {}, params).state, TrackingState::lost);
  EXPECT_EQ(quality_of(track, {}, params).p_good, 0.0f);
}

TEST(PoseQuality, ADegenerateRegistrationIsLost) {
  TrackResult track = registered();
  track.status = Status::degenerate;
  EXPECT_EQ(quality_of(track, {}, {}).state, TrackingState::lost);
}

TEST(PoseQuality, ADirectionThatIsLeftOpenIsPoor) {
  TrackResult track = registered();
  track.covariance[at(0, 0)] = 0.04f * 0.04f;  // along a bare wall
  EXPECT_EQ(quality_of(track, {}, {}).state, TrackingState::poor);
  EXPECT_LT(quality_of(track, {}, {}).p_good, 0.9f);
}

TEST(PoseQuality, AJumpIsPoor) {
  TrackResult track = registered();
  const TrackParams params;
  track.T_world_cam.translation.x = 1.01f * params.prior_reach_m;
  EXPECT_EQ(quality_of(track, {}, params).state, TrackingState::poor);
  track.T_world_cam = exp(Twist{{}, {0, 0, 1.01f * params.prior_reach_rad}});
  EXPECT_EQ(quality_of(track, {}, params).state, TrackingState::poor);
  track.T_world_cam = exp(Twist{{0.9f * params.prior_reach_m, 0, 0}, {}});
  EXPECT_EQ(quality_of(track, {}, params).state, TrackingState::good);
}

TEST(PoseQuality, APredictionIsPoorUntilItIsUnsure) {
  EXPECT_EQ(quality_of_prediction({0.002f, 0.002f, 0.002f, 0.002f, 0.002f, 0.002f}).state,
            TrackingState::poor);
  EXPECT_EQ(quality_of_prediction({0.04f, 0.002f, 0.002f, 0.002f, 0.002f, 0.002f}).state,
            TrackingState::lost);
}

TEST(PoseQuality, StatesHaveNames) {
  EXPECT_STREQ(to_string(TrackingState::good), "good");
  EXPECT_STREQ(to_string(TrackingState::poor), "poor");
  EXPECT_STREQ(to_string(TrackingState::lost), "lost");
}

}  // namespace
}  // namespace stillmap
