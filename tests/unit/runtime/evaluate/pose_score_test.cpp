#include "runtime/evaluate/pose_score.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr double kSigma_m = 0.002, kSigma_rad = 0.001;

FrameResult frame(const Se3d& T_map_cam, TrackingState state = TrackingState::good) {
  FrameResult result;
  result.state = state;
  result.T_map_cam = T_map_cam;
  for (int row = 0, i = 0; row < 6; i += 6 - row, ++row)
    result.covariance[i] = static_cast<float>(row < 3 ? kSigma_m * kSigma_m : kSigma_rad * kSigma_rad);
  return result;
}

Se3d shifted(double x_m, double rz_rad = 0) {
  return exp(Twistd{{x_m, 0, 0}, {0, 0, rz_rad}});
}

/// A camera that turns and goes forward.
Se3d camera(int i) {
  return exp(Twistd{{0.01 * i, 0.002 * i, 0.5}, {0, 0.01 * i, 0}});
}

TEST(PoseScore, TheFirstPoseAlignsTheMap) {
  PoseScore score;
  const Se3d T_map_world = shifted(3, 1.2);
  for (int i = 0; i < 5; ++i) {
    const PoseErrors e = score.add(frame(T_map_world * camera(i)), camera(i), {});
    EXPECT_LT(e.error_m, 1e-12);
    EXPECT_LT(e.error_deg, 1e-6);
    EXPECT_FALSE(e.off);
  }
  EXPECT_EQ(score.counts().good, 5u);
  EXPECT_NEAR(score.counts().path_m, norm(camera(4).translation - camera(0).translation), 1e-3);
}

TEST(PoseScore, OffBeyondFiveCentimetresOrThreeDegrees) {
  PoseScore score;
  score.add(frame({}), Se3d{}, {});
  EXPECT_FALSE(score.add(frame(shifted(0.049)), Se3d{}, {}).off);
  EXPECT_TRUE(score.add(frame(shifted(0.051)), Se3d{}, {}).off);
  EXPECT_FALSE(score.add(frame(shifted(0, 2.9 / 57.2958)), Se3d{}, {}).off);
  EXPECT_TRUE(score.add(frame(shifted(0, 3.1 / 57.2958), TrackingState::poor), Se3d{}, {}).off);
  EXPECT_TRUE(score.add(frame(shifted(1), TrackingState::lost), Se3d{}, {}).off);
  EXPECT_EQ(score.counts().good, 4u);
  EXPECT_EQ(score.counts().good_off, 1u);
  EXPECT_EQ(score.counts().undeclared_loss, 2u);
}

TEST(PoseScore, ALossCountsWhereEnoughStandsStill) {
  PoseScore score;
  const double unknown = std::nan("");
  score.add(frame({}, TrackingState::lost), Se3d{}, {0.25, 0.1});
  score.add(frame({}, TrackingState::lost), Se3d{}, {0.24, 0.3});
  score.add(frame({}, TrackingState::lost), Se3d{}, {unknown, unknown});
  score.add(frame({}), Se3d{}, {0.9, 0.6});
  EXPECT_EQ(score.counts().declared_loss, 1u);
  EXPECT_EQ(score.counts().in_view, 2u);
  EXPECT_EQ(score.counts().in_view_good, 1u);
}

TEST(PoseScore, WithoutTruthNothingIsJudged) {
  PoseScore score;
  EXPECT_TRUE(std::isnan(score.add(frame({}), {}, {}).error_m));
  EXPECT_EQ(score.counts().frames, 0u);
  EXPECT_FALSE(score.T_map_world());
}

/// Share inside the bound when poses scatter with `times` the reported sigma, the map drifting all the while.
double share_inside(double times) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto n = [&](double sigma) { return times * sigma * normal(random); };
  PoseScore score;
  for (int i = 0; i < 1500; ++i) {
    const Se3d drift = shifted(1e-5 * i, 2e-6 * i);
    const Twistd error = {{n(kSigma_m), n(kSigma_m), n(kSigma_m)},
                          {n(kSigma_rad), n(kSigma_rad), n(kSigma_rad)}};
    score.add(frame(i == 0 ? camera(0) : exp(error) * drift * camera(i % 100)), camera(i % 100), {});
  }
  EXPECT_EQ(score.counts().chi2_frames, 1470u);
  return static_cast<double>(score.counts().chi2_inside) / static_cast<double>(score.counts().chi2_frames);
}

TEST(PoseScore, ARightCovarianceHolds95PercentThoughTheMapDrifts) {
  EXPECT_NEAR(share_inside(1), 0.94, 0.02);  // the mean over the window scatters as well
  EXPECT_LT(share_inside(2), 0.5);
  EXPECT_GT(share_inside(0.5), 0.995);
}

TEST(PoseScore, ALossEmptiesTheWindow) {
  PoseScore score;
  for (int i = 0; i < 30; ++i) score.add(frame({}), Se3d{}, {});
  EXPECT_FALSE(std::isnan(score.add(frame({}), Se3d{}, {}).chi2));
  score.add(frame({}, TrackingState::lost), Se3d{}, {});
  EXPECT_TRUE(std::isnan(score.add(frame({}), Se3d{}, {}).chi2));
}

TEST(ChiSquare, IsTheSquareOverTheVariance) {
  const FrameResult result = frame({});
  const Twistd x = {{kSigma_m, 0, 2 * kSigma_m}, {0, kSigma_rad, 0}};
  EXPECT_NEAR(chi_square(x, result.covariance), 6, 1e-5);
  const float nothing[21] = {};
  EXPECT_TRUE(std::isnan(chi_square(x, nothing)));
}

}  // namespace
}  // namespace stillmap
