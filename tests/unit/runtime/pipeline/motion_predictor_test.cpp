#include "runtime/pipeline/motion_predictor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "runtime/ports/odometry_ring.hpp"

namespace stillmap {
namespace {

constexpr int64_t kFrameNs = 33333333;

Stamp frame_stamp(int index) {
  return {1000000000 + index * kFrameNs};
}

using Path = std::function<Se3d(double t_s)>;

Se3d forward(double metres) {
  return {{}, {0, 0, metres}};
}

/// Steady walk of 1 m/s with a turn of 0.6 rad/s.
Se3d walk(double t_s) {
  return exp(Twistd{{0, 0, t_s}, {0, 0.6 * t_s, 0}});
}

/// Odometry that holds what a test puts in.
class HeldOdometry : public OdometryPort {
 public:
  Status at(Stamp stamp, OdometrySample& sample) override { return ring.at(stamp, sample); }
  OdometryRing ring;
};

class MotionPredictorTest : public testing::Test {
 protected:
  double t_of(int frame) const { return static_cast<double>(frame * kFrameNs) * 1e-9; }

  void follow(MotionPredictor& predictor, const Path& path, int from, int to) const {
    for (int i = from; i < to; ++i) predictor.update(frame_stamp(i), path(t_of(i)));
  }
  /// Distance of a prediction from where the camera will be.
  double miss_m(const PredictedPose& p, const Se3d& truth) const {
    return norm(p.T_map_cam.translation - truth.translation);
  }
  double turn_between(const Se3d& a, const Se3d& b) const {
    return norm(log_rotation(transposed(a.rotation) * b.rotation));
  }

  /// Body as the default mount has it, samples every 20 ms up to `until_s`.
  /// @param seen what the odometry makes of the path
  void feed(HeldOdometry& odometry, const Path& seen, double until_s) const {
    const Se3d T_body_cam = {rotation_from(Quatd{-0.5, 0.5, -0.5, 0.5}), {}};
    for (int i = 0; i * 0.02 <= until_s + 1e-9; ++i)
      odometry.ring.push({{1000000000 + i * int64_t{20000000}}, seen(i * 0.02) * inverse(T_body_cam)});
  }

  Config config_;
};

TEST_F(MotionPredictorTest, KnowsNothingBeforeTheFirstPoses) {
  const Se3d start = forward(3);
  MotionPredictor predictor(config_, start);
  const PredictedPose first = predictor.predict(frame_stamp(0));
  EXPECT_EQ(miss_m(first, start), 0);
  EXPECT_EQ(first.sigma[0], config_.track.prior_reach_m);
  EXPECT_EQ(first.sigma[5], config_.track.prior_reach_rad);
  predictor.update(frame_stamp(0), start);
  const PredictedPose second = predictor.predict(frame_stamp(1));
  EXPECT_EQ(miss_m(second, start), 0);
  EXPECT_EQ(second.sigma[2], config_.track.prior_reach_m);
}

TEST_F(MotionPredictorTest, ContinuesASteadyMotionAndBecomesSure) {
  MotionPredictor predictor(config_, {});
  follow(predictor, walk, 0, 3);
  const float early = predictor.predict(frame_stamp(3)).sigma[2];
  follow(predictor, walk, 3, 60);
  const PredictedPose p = predictor.predict(frame_stamp(60));
  // Of the 33 mm and 20 mrad of a frame a tenth is not believed.
  EXPECT_LT(miss_m(p, walk(t_of(60))), 0.005);
  EXPECT_LT(turn_between(p.T_map_cam, walk(t_of(60))), 0.003);
  EXPECT_LT(p.sigma[2], 0.3f * early);
  EXPECT_LT(p.sigma[2], 0.008f);
  EXPECT_GE(p.sigma[2], 0.5 * miss_m(p, walk(t_of(60))));
  EXPECT_LT(p.sigma[0], 1.2f * config_.track.prior_floor_m);
  EXPECT_EQ(p.from, MotionPrior::constant_velocity);
}

TEST_F(MotionPredictorTest, OnlyTheAxisWhoseMotionChangesIsDoubted) {
  const Path path = [](double t) { return forward(t < 1.0 ? t : 1.0); };  // stops after a second
  MotionPredictor predictor(config_, {});
  follow(predictor, path, 0, 30);
  const PredictedPose before = predictor.predict(frame_stamp(30));
  follow(predictor, path, 30, 32);
  const PredictedPose after = predictor.predict(frame_stamp(32));
  EXPECT_GT(after.sigma[2], 2 * before.sigma[2]);
  EXPECT_EQ(after.sigma[0], before.sigma[0]);
  EXPECT_EQ(after.sigma[4], before.sigma[4]);
  EXPECT_GE(after.sigma[2], 0.9 * miss_m(after, path(t_of(32))));
  follow(predictor, path, 32, 40);
  EXPECT_LT(miss_m(predictor.predict(frame_stamp(40)), path(2.0)), 0.001);
  follow(predictor, path, 40, 120);
  EXPECT_LT(predictor.predict(frame_stamp(120)).sigma[2], 1.2f * config_.track.prior_floor_m);
}

TEST_F(MotionPredictorTest, SigmaCoversMostErrorsOfAnUnsteadyHand) {
  const Path path = [](double t) {
    return exp(Twistd{{0.05 * std::sin(7 * t), 0.02 * std::sin(11 * t), 0.3 * t},
                      {0.03 * std::sin(9 * t), 0.1 * std::sin(3 * t), 0}});
  };
  MotionPredictor predictor(config_, {});
  follow(predictor, path, 0, 10);
  int inside[6] = {};
  constexpr int kFrames = 300;
  for (int i = 10; i < 10 + kFrames; ++i) {
    const PredictedPose p = predictor.predict(frame_stamp(i));
    const Twistd error = log(inverse(p.T_map_cam) * path(t_of(i)));
    const double e[6] = {error.v.x, error.v.y, error.v.z, error.w.x, error.w.y, error.w.z};
    for (int k = 0; k < 6; ++k) inside[k] += std::abs(e[k]) <= 2.0 * static_cast<double>(p.sigma[k]) ? 1 : 0;
    predictor.update(frame_stamp(i), path(t_of(i)));
  }
  for (const int count : inside) EXPECT_GE(count, 0.95 * kFrames);
}

TEST_F(MotionPredictorTest, AGapLeadsBackToTheLastPoseAndWidensSigma) {
  MotionPredictor predictor(config_, {});
  follow(predictor, walk, 0, 60);
  const Se3d last = walk(t_of(59));
  double way_before = 0;
  float sigma_before = 0;
  for (const int gap : {1, 3, 6}) {
    const PredictedPose p = predictor.predict(frame_stamp(59 + gap));
    EXPECT_GT(miss_m(p, last), way_before);
    EXPECT_GT(p.sigma[2], sigma_before);
    way_before = miss_m(p, last);
    sigma_before = p.sigma[2];
  }
  const PredictedPose second = predictor.predict(frame_stamp(59 + 30));
  EXPECT_LT(miss_m(second, last), way_before);
  EXPECT_EQ(second.sigma[2], config_.track.prior_reach_m);
  const PredictedPose late = predictor.predict({frame_stamp(59).ns + 5000000000});
  EXPECT_LT(miss_m(late, last), 1e-4);
  EXPECT_EQ(late.sigma[0], config_.track.prior_reach_m);
  // Found again after the gap: the way over it is not taken for a velocity.
  predictor.update({frame_stamp(59).ns + 5000000000}, forward(9));
  EXPECT_EQ(miss_m(predictor.predict({frame_stamp(60).ns + 5000000000}), forward(9)), 0);
}

TEST_F(MotionPredictorTest, StampsThatDoNotRiseGiveTheLastPose) {
  MotionPredictor predictor(config_, {});
  follow(predictor, walk, 0, 30);
  for (const int index : {29, 10}) {
    const PredictedPose p = predictor.predict(frame_stamp(index));
    EXPECT_EQ(miss_m(p, walk(t_of(29))), 0);
    EXPECT_EQ(p.sigma[0], config_.track.prior_reach_m);
  }
  predictor.update(frame_stamp(10), forward(2));
  EXPECT_EQ(miss_m(predictor.predict(frame_stamp(11)), forward(2)), 0);
}

TEST_F(MotionPredictorTest, NeverGoesFartherThanItsReach) {
  const Path path = [](double t) { return forward(40 * t); };
  MotionPredictor predictor(config_, {});
  follow(predictor, path, 0, 10);
  const PredictedPose p = predictor.predict(frame_stamp(10));
  EXPECT_NEAR(miss_m(p, path(t_of(9))), static_cast<double>(config_.track.prior_reach_m), 1e-6);
  EXPECT_EQ(p.sigma[2], config_.track.prior_reach_m);
}

TEST_F(MotionPredictorTest, TheLastPoseIsAPriorWhoseSigmaIsTheMotion) {
  config_.track.prior = MotionPrior::last_pose;
  MotionPredictor predictor(config_, {});
  follow(predictor, walk, 0, 30);
  const PredictedPose p = predictor.predict(frame_stamp(30));
  EXPECT_EQ(miss_m(p, walk(t_of(29))), 0);
  EXPECT_EQ(p.from, MotionPrior::last_pose);
  EXPECT_NEAR(p.sigma[2], 0.033, 0.01);
}

TEST_F(MotionPredictorTest, FreshOdometryFollowsWhatNoVelocityForesees) {
  config_.track.prior = MotionPrior::odometry;
  // To and fro five times a second.
  const Path path = [](double t) { return forward(0.1 * std::sin(31 * t)); };
  HeldOdometry odometry;
  MotionPredictor with(config_, {}, &odometry), without(config_, {});
  double miss_with = 0, miss_without = 0;
  for (int i = 0; i < 60; ++i) {
    feed(
        odometry,
        [&](double t) {
          return exp(Twistd{{4, 5, 6}, {1, 0.2, 0.1}}) * path(t);
        },
        t_of(i) + 0.02);
    const PredictedPose p = with.predict(frame_stamp(i));
    if (i > 2) {
      EXPECT_EQ(p.from, MotionPrior::odometry);
      miss_with += miss_m(p, path(t_of(i)));
      miss_without += miss_m(without.predict(frame_stamp(i)), path(t_of(i)));
    }
    with.update(frame_stamp(i), path(t_of(i)));
    without.update(frame_stamp(i), path(t_of(i)));
  }
  EXPECT_LT(miss_with, 0.1 * miss_without);
}

TEST_F(MotionPredictorTest, StaleOrMissingOdometryLeavesTheVelocity) {
  config_.track.prior = MotionPrior::odometry;
  HeldOdometry odometry;
  MotionPredictor predictor(config_, {}, &odometry), alone(config_, {});
  feed(odometry, walk, t_of(29));
  for (int i = 0; i < 40; ++i) {
    const PredictedPose p = predictor.predict(frame_stamp(i)), q = alone.predict(frame_stamp(i));
    // The last sample lies 0 to 20 ms before frame 29; a frame later it is still fresh, no newer one is there
    // before frame 30 to say how the body moved since.
    if (i > 31) {
      EXPECT_EQ(p.from, MotionPrior::constant_velocity);
      EXPECT_EQ(p.T_map_cam.translation.z, q.T_map_cam.translation.z);
      EXPECT_EQ(p.sigma, q.sigma);
    }
    predictor.update(frame_stamp(i), walk(t_of(i)));
    alone.update(frame_stamp(i), walk(t_of(i)));
  }
  HeldOdometry silent;
  MotionPredictor unheard(config_, {}, &silent);
  follow(unheard, walk, 0, 10);
  EXPECT_EQ(unheard.predict(frame_stamp(10)).from, MotionPrior::constant_velocity);
}

TEST_F(MotionPredictorTest, TheTimeOffsetIsAddedToTheOdometrysStamps) {
  config_.track.prior = MotionPrior::odometry;
  config_.odometry.time_offset_ms = 40;
  const Path path = [](double t) { return forward(0.1 * std::sin(31 * t)); };
  HeldOdometry odometry;  // its clock is 40 ms behind
  feed(
      odometry, [&](double t) { return path(t + 0.04); }, 3.0);
  MotionPredictor predictor(config_, {}, &odometry);
  follow(predictor, path, 3, 30);
  // Between samples it is the chord that is known: 5 mm at this acceleration.
  EXPECT_LT(miss_m(predictor.predict(frame_stamp(30)), path(t_of(30))), 0.006);
  config_.odometry.time_offset_ms = 0;
  MotionPredictor late(config_, {}, &odometry);
  follow(late, path, 3, 30);
  EXPECT_GT(miss_m(late.predict(frame_stamp(30)), path(t_of(30))), 0.02);
}

TEST_F(MotionPredictorTest, NoisyOdometryHasTheSigmaOfItsWay) {
  config_.track.prior = MotionPrior::odometry;
  HeldOdometry odometry;
  feed(
      odometry, [](double t) { return walk(1.02 * t); }, t_of(60));
  MotionPredictor predictor(config_, {}, &odometry);
  follow(predictor, walk, 0, 60);
  const PredictedPose p = predictor.predict(frame_stamp(60));
  EXPECT_EQ(p.from, MotionPrior::odometry);
  EXPECT_LT(miss_m(p, walk(t_of(60))), 0.0015);
  EXPECT_LE(miss_m(p, walk(t_of(60))), static_cast<double>(p.sigma[2]));
  EXPECT_LT(p.sigma[2], 0.003f);
}

TEST_F(MotionPredictorTest, WheelsThatSlipLoseTheirWeightAndGetItBack) {
  config_.track.prior = MotionPrior::odometry;
  // They turn without grip for 0.3 s and tell 1 m/s more than the camera sees.
  const auto slip_m = [](double t) { return t < 1 ? 0.0 : t > 1.3 ? 0.3 : t - 1; };
  HeldOdometry odometry;
  feed(
      odometry, [&](double t) { return forward(0.3 * t + slip_m(t)); }, 20 * 0.25);
  const Path path = [](double t) { return forward(0.3 * t); };
  MotionPredictor predictor(config_, {}, &odometry);
  follow(predictor, path, 0, 30);
  const float sure = predictor.predict(frame_stamp(30)).sigma[2];
  follow(predictor, path, 30, 34);
  const PredictedPose slipping = predictor.predict(frame_stamp(34));
  const double miss = miss_m(slipping, path(t_of(34)));
  EXPECT_GT(miss, 0.02);
  EXPECT_GT(slipping.sigma[2], 5 * sure);
  EXPECT_GT(static_cast<double>(slipping.sigma[2]), 0.7 * miss);
  EXPECT_LT(slipping.sigma[0], 0.003f);
  follow(predictor, path, 34, 140);
  EXPECT_LT(predictor.predict(frame_stamp(140)).sigma[2], 1.5f * sure);
}

TEST_F(MotionPredictorTest, TheMountTurnsTheBodysWayIntoTheCameras) {
  config_.track.prior = MotionPrior::odometry;
  config_.mount.T_body_cam = {0.3f, 0, 0.5f, 0, 0, 0, 1};  // axes as the body's, ahead of its centre
  HeldOdometry odometry;
  const auto body = [](double t) { return exp(Twistd{{t, 0, 0}, {0, 0, 0.5 * t}}); };
  for (int i = 0; i < 200; ++i) odometry.ring.push({{1000000000 + i * int64_t{20000000}}, body(i * 0.02)});
  const Se3d T_body_cam = {{}, {0.3f, 0, 0.5}};
  const Path path = [&](double t) { return inverse(T_body_cam) * body(t) * T_body_cam; };
  MotionPredictor predictor(config_, {}, &odometry);
  follow(predictor, path, 0, 2);
  EXPECT_LT(miss_m(predictor.predict(frame_stamp(2)), path(t_of(2))), 1e-5);
}

TEST_F(MotionPredictorTest, InformationTurnsWithTheCamera) {
  PredictedPose p;
  p.T_map_cam = exp(Twistd{{1, 2, 3}, {0, 0, 1.5707963267948966}});  // camera's x is the map's y
  p.sigma = {0.1f, 0.2f, 0.5f, 0.01f, 0.02f, 0.05f};
  double information[21];
  information_in_map_axes(p, information);
  constexpr int kDiagonal[6] = {0, 6, 11, 15, 18, 20};
  const double expected[6] = {25, 100, 4, 2500, 10000, 400};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(information[kDiagonal[i]], expected[i], 1e-3 * expected[i]);
  for (int k = 0; k < 21; ++k)
    if (std::find(kDiagonal, kDiagonal + 6, k) == kDiagonal + 6) {
      EXPECT_NEAR(information[k], 0, 1e-3) << k;
    }
  // Turned by 45 degrees the two axes mix.
  p.T_map_cam = exp(Twistd{{}, {0, 0, 0.7853981633974483}});
  information_in_map_axes(p, information);
  EXPECT_NEAR(information[0], 62.5, 0.01);
  EXPECT_NEAR(information[1], 37.5, 0.01);
}

}  // namespace
}  // namespace stillmap
