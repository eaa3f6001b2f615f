#include "runtime/evaluate/ate.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "runtime/evaluate/report.hpp"
#include "tests/unit/runtime/evaluate/made_trajectories.hpp"

namespace stillmap {
namespace {

TimedPose pose_at(double seconds, double x, double y, double z) {
  return {Stamp{std::llround(seconds * 1e9)}, Se3d{{}, {x, y, z}}};
}

/// Four corners of a square of side 2 in the plane z = 0.
Trajectory square() {
  return {{pose_at(1, 0, 0, 0), pose_at(2, 2, 0, 0), pose_at(3, 2, 2, 0), pose_at(4, 0, 2, 0)}};
}

TEST(Statistics, OfFourNumbers) {
  const Statistics s = statistics_of({4, 1, 2, 3});
  EXPECT_EQ(s.count, 4u);
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(1.25));
  EXPECT_EQ(s.min, 1);
  EXPECT_EQ(s.max, 4);
  EXPECT_EQ(statistics_of({5, 1, 9}).median, 5);
  EXPECT_EQ(statistics_of({}).count, 0u);
}

TEST(Associate, TakesTheSmallestDifferenceFirst) {
  // Greedy, not nearest: estimate 1.010 goes to truth 1.012, so estimate 1.000 has to take truth 1.015.
  const Trajectory truth = {{pose_at(1.012, 0, 0, 0), pose_at(1.015, 0, 0, 0), pose_at(3, 0, 0, 0)}};
  const Trajectory estimate = {{pose_at(1.000, 0, 0, 0), pose_at(1.010, 0, 0, 0), pose_at(3.02, 0, 0, 0)}};
  const auto pairs = associate(truth, estimate, 0.02);
  ASSERT_EQ(pairs.size(), 2u);  // 3 and 3.02 are not nearer than 0.02
  EXPECT_EQ(pairs[0].estimate, 1u);
  EXPECT_EQ(pairs[1].estimate, 0u);
}

TEST(Associate, EqualsBruteForce) {
  for (uint64_t seed = 1; seed <= 12; ++seed)
    for (const double max_dt_s : {0.004, 0.02, 0.5, 100.0}) {
      const auto made = test::make_pair_of_trajectories(seed, seed % 2 == 0 ? 1.3e9 : 0.0, 4);
      const auto pairs = associate(made.truth, made.estimate, max_dt_s);
      const auto expected = test::naive_associate(made.naive_truth, made.naive_estimate, max_dt_s);
      ASSERT_EQ(pairs.size(), expected.size()) << seed << " " << max_dt_s;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        ASSERT_EQ(pairs[i].truth, expected[i].first) << seed << " " << max_dt_s;
        ASSERT_EQ(pairs[i].estimate, expected[i].second) << seed << " " << max_dt_s;
      }
    }
}

TEST(Associate, EqualsBruteForceWhereEveryDifferenceIsATie) {
  test::MadePair made;
  for (int64_t i = 0; i < 200; ++i)
    test::add_pose(made.truth, made.naive_truth, 1300000000000000000 + i * 10'000'000, test::path_at(0));
  for (int64_t i = 0; i < 60; ++i)
    test::add_pose(made.estimate, made.naive_estimate, 1300000000005000000 + i * 30'000'000,
                   test::path_at(0));
  const auto pairs = associate(made.truth, made.estimate, 0.02);
  const auto expected = test::naive_associate(made.naive_truth, made.naive_estimate, 0.02);
  ASSERT_EQ(pairs.size(), expected.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(pairs[i].truth, expected[i].first);
    EXPECT_EQ(pairs[i].estimate, expected[i].second);
  }
}

TEST(Associate, HundredThousandPosesWithAnyMaximum) {
  Trajectory truth, estimate;
  for (int64_t i = 0; i < 100'000; ++i) {
    truth.poses.push_back({Stamp{i * 10'000'000}, {}});
    estimate.poses.push_back({Stamp{i * 10'000'000 + 3'000'000}, {}});
  }
  const auto pairs = associate(truth, estimate, 1e6);
  ASSERT_EQ(pairs.size(), 100'000u);
  for (const PosePair& pair : pairs) ASSERT_EQ(pair.truth, pair.estimate);
}

TEST(Ate, RigidTransformationIsNoError) {
  const auto made = test::make_pair_of_trajectories(7, 1.3e9);
  Trajectory moved = made.truth;
  const Se3d T = exp(Twistd{{3, -20, 7}, {0.3, 2.1, -0.9}});
  for (TimedPose& pose : moved.poses) pose.T_world_cam = T * pose.T_world_cam;
  const auto ate = absolute_trajectory_error(made.truth, moved);
  ASSERT_TRUE(ate);
  EXPECT_LT(ate->translation_m.max, 1e-12);
  EXPECT_EQ(ate->matched_share_estimate(), 1);
  EXPECT_EQ(ate->matched_share_truth(), 1);
  const Se3d identity = ate->T_truth_estimate * T;
  EXPECT_LT(norm(log(identity).v) + norm(log(identity).w), 1e-9);
}

TEST(Ate, ScaleIsNotAligned) {
  Trajectory larger = square();
  for (TimedPose& pose : larger.poses) pose.T_world_cam.translation = 1.5 * pose.T_world_cam.translation;
  const auto ate = absolute_trajectory_error(square(), larger);
  ASSERT_TRUE(ate);
  // A corner is sqrt(2) from the centre; half of that more is the error.
  EXPECT_NEAR(ate->translation_m.rmse, 0.5 * std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(ate->translation_m.std, 0, 1e-9);
}

TEST(Ate, AMirroredTrajectoryIsNoRotation) {
  Trajectory truth = square();
  truth.poses.push_back(pose_at(5, 1, 1, 3));
  Trajectory mirrored = truth;
  for (TimedPose& pose : mirrored.poses) pose.T_world_cam.translation.x *= -1;
  const auto ate = absolute_trajectory_error(truth, mirrored);
  ASSERT_TRUE(ate);
  EXPECT_GT(ate->translation_m.rmse, 0.1);
  const Mat3T<double>& r = ate->T_truth_estimate.rotation;
  const Vec3d x = {r(0, 0), r(1, 0), r(2, 0)}, y = {r(0, 1), r(1, 1), r(2, 1)},
              z = {r(0, 2), r(1, 2), r(2, 2)};
  EXPECT_NEAR(dot(cross(x, y), z), 1, 1e-12);
}

TEST(Ate, HandComputed) {
  // One corner lifted by 4h: the best fit tilts and shifts, every corner keeps an error of h off the plane (h
  // << side).
  const double h = 1e-4;
  Trajectory estimate = square();
  estimate.poses[2].T_world_cam.translation.z = 4 * h;
  const auto ate = absolute_trajectory_error(square(), estimate);
  ASSERT_TRUE(ate);
  EXPECT_NEAR(ate->translation_m.rmse, h, 1e-7);
  EXPECT_NEAR(ate->translation_m.max, h, 1e-7);
}

TEST(Ate, EqualsTheNaiveImplementation) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const auto made = test::make_pair_of_trajectories(seed, 1.3e9 + static_cast<double>(seed));
    const auto ate = absolute_trajectory_error(made.truth, made.estimate, 0.02);
    ASSERT_TRUE(ate);
    const std::vector<double> expected = test::naive_ate(made.naive_truth, made.naive_estimate, 0.02);
    ASSERT_EQ(ate->errors_m.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_NEAR(ate->errors_m[i], expected[i], 1e-6);
    double squares = 0;
    for (const double e : expected) squares += e * e;
    EXPECT_NEAR(ate->translation_m.rmse, std::sqrt(squares / static_cast<double>(expected.size())), 1e-9);
    EXPECT_GT(ate->translation_m.rmse, 0.01);
    EXPECT_LT(ate->matched_share_estimate(), 1);  // the estimate outlasts the truth
    EXPECT_GT(ate->matched_share_estimate(), 0.8);
  }
}

TEST(Ate, NeedsTwoPairs) {
  Trajectory far = square();
  for (TimedPose& pose : far.poses) pose.stamp.ns += 1'000'000'000'000;
  far.poses[0].stamp = square().poses[0].stamp;
  const auto ate = absolute_trajectory_error(square(), far);
  ASSERT_FALSE(ate);
  EXPECT_NE(ate.error().find("1 of 4 poses"), std::string::npos) << ate.error();
}

TEST(Ate, AllPosesInOnePlaceAreAlignedToo) {
  Trajectory still = square();
  for (TimedPose& pose : still.poses) pose.T_world_cam.translation = {5, 5, 5};
  const auto ate = absolute_trajectory_error(square(), still);
  ASSERT_TRUE(ate);
  EXPECT_NEAR(ate->translation_m.rmse, std::sqrt(2.0), 1e-12);
}

TEST(AteReport, SaysFiguresAndShares) {
  const auto made = test::make_pair_of_trajectories(3, 1.3e9);
  const auto ate = absolute_trajectory_error(made.truth, made.estimate, 0.02);
  ASSERT_TRUE(ate);
  EXPECT_NE(ate_text(*ate).find("absolute_translational_error.rmse"), std::string::npos);
  EXPECT_NE(ate_text(*ate).find("matched_share"), std::string::npos);
  EXPECT_NE(ate_json(*ate).find("\"rmse_m\""), std::string::npos);
  EXPECT_NE(ate_json(*ate).find("\"matched_share\""), std::string::npos);
}

}  // namespace
}  // namespace stillmap
