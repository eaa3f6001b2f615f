#include "runtime/evaluate/rpe.hpp"

#include <cmath>
#include <sstream>

#include <gtest/gtest.h>

#include "runtime/evaluate/report.hpp"
#include "tests/unit/runtime/evaluate/made_trajectories.hpp"

namespace stillmap {
namespace {

/// `count` poses `step_s` apart that move along x at `speed_m_s` and turn about y at `turn_rad_s`.
Trajectory straight(int count, double step_s, double speed_m_s, double turn_rad_s = 0) {
  Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    const double t = i * step_s;
    const Se3d T = {exp(Twistd{{}, {0, turn_rad_s * t, 0}}).rotation, {speed_m_s * t, 0, 0}};
    trajectory.poses.push_back({Stamp{std::llround(t * 1e9)}, T});
  }
  return trajectory;
}

TEST(Rpe, HandComputedDrift) {
  // 0.5 m/s against 0.4 m/s: 10 cm in each second.
  const auto rpe = relative_pose_error(straight(51, 0.1, 0.4), straight(51, 0.1, 0.5), 1.0);
  ASSERT_TRUE(rpe);
  EXPECT_EQ(rpe->samples.size(), 40u);  // 0..39; what ends in the last pose is left out
  EXPECT_NEAR(rpe->translation_m.rmse, 0.1, 1e-9);
  EXPECT_NEAR(rpe->translation_m.max, 0.1, 1e-9);
  EXPECT_NEAR(rpe->rotation_deg.max, 0, 1e-9);
}

TEST(Rpe, RotationInDegreesAndDeltaInSeconds) {
  const double turn = 2 * M_PI / 180;  // of the estimate, in a second
  const auto rpe = relative_pose_error(straight(101, 0.1, 0), straight(101, 0.1, 0, turn), 2.0);
  ASSERT_TRUE(rpe);
  EXPECT_NEAR(rpe->rotation_deg.median, 4, 1e-9);
  EXPECT_NEAR(rpe->rotation_deg.min, 4, 1e-9);
  EXPECT_NEAR(rpe->translation_m.max, 0, 1e-12);
}

TEST(Rpe, AnotherFrameIsNoError) {
  const auto made = test::make_pair_of_trajectories(7, 1.3e9);
  Trajectory moved = made.truth;
  const Se3d T = exp(Twistd{{3, -20, 7}, {0.3, 2.1, -0.9}});
  for (TimedPose& pose : moved.poses) pose.T_world_cam = T * pose.T_world_cam;
  const auto rpe = relative_pose_error(made.truth, moved);
  ASSERT_TRUE(rpe);
  EXPECT_LT(rpe->translation_m.max, 1e-9);
  EXPECT_LT(rpe->rotation_deg.max, 1e-6);
}

TEST(Rpe, EqualsTheNaiveImplementation) {
  for (uint64_t seed = 1; seed <= 6; ++seed)
    for (const double delta_s : {0.2, 1.0, 3.7}) {
      const auto made = test::make_pair_of_trajectories(seed, 1.3e9);
      const auto rpe = relative_pose_error(made.truth, made.estimate, delta_s);
      ASSERT_TRUE(rpe);
      const auto expected = test::naive_rpe(made.naive_truth, made.naive_estimate, delta_s);
      ASSERT_EQ(rpe->samples.size(), expected.size()) << seed << " " << delta_s;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        ASSERT_NEAR(rpe->samples[i].translation_m, expected[i].first, 1e-6);
        ASSERT_NEAR(rpe->samples[i].rotation_deg, expected[i].second,
                    2e-6);  // acos of nearly 1 knows no better
      }
      EXPECT_GT(rpe->translation_m.rmse, 0.01);
    }
}

TEST(Rpe, BothDefinitionsAgreeWithoutRotation) {
  const auto rpe = relative_pose_error(straight(51, 0.1, 0.4), straight(51, 0.1, 0.5), 1.0);
  ASSERT_TRUE(rpe);
  EXPECT_NEAR(rpe->translation_eq2_m.rmse, rpe->translation_m.rmse, 1e-12);
}

TEST(Rpe, RefusesWhatComparesNothing) {
  EXPECT_FALSE(relative_pose_error(straight(51, 0.1, 0.4), straight(51, 0.1, 0.4), 100));
  EXPECT_FALSE(relative_pose_error(straight(51, 0.1, 0.4), straight(51, 0.1, 0.4), 0.001));
  EXPECT_FALSE(relative_pose_error(straight(1, 0.1, 0.4), straight(51, 0.1, 0.4), 1));
  Trajectory late = straight(51, 0.1, 0.4);
  for (TimedPose& pose : late.poses) pose.stamp.ns += 1'000'000'000'000;
  const auto rpe = relative_pose_error(straight(51, 0.1, 0.4), late, 1);
  ASSERT_FALSE(rpe);
  EXPECT_NE(rpe.error().find("at least 2"), std::string::npos);
}

TEST(Rpe, CsvHasALineForEachSample) {
  Trajectory truth = straight(51, 0.1, 0.4), estimate = straight(51, 0.1, 0.5);
  for (Trajectory* t : {&truth, &estimate})
    for (TimedPose& pose : t->poses) pose.stamp.ns += 1305031229'433100000;
  const auto rpe = relative_pose_error(truth, estimate, 1.0);
  ASSERT_TRUE(rpe);
  std::istringstream csv(rpe_csv(*rpe));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "stamp,trans_m,rot_deg");
  std::getline(csv, line);
  EXPECT_EQ(line, "1305031229.433100000,0.100000000,0.000000000");
  int lines = 1;
  while (std::getline(csv, line)) ++lines;
  EXPECT_EQ(lines, 40);
  EXPECT_NE(rpe_text(*rpe, 1.0).find("translational_error.rmse 0.100000 m"), std::string::npos)
      << rpe_text(*rpe, 1.0);
  EXPECT_NE(rpe_json(*rpe, 1.0).find("\"trans_rmse_m\""), std::string::npos);
}

}  // namespace
}  // namespace stillmap
