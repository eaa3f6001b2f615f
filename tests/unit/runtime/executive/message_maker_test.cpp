#include "runtime/executive/message_maker.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stillmap {
namespace {

constexpr double kRad = std::numbers::pi / 180;
constexpr int64_t kPeriod_ns = 33'333'333;

class Messages : public testing::Test {
 protected:
  MessageMaker maker() { return {config, clock, state, {}}; }
  /// The camera after it moved, in its own first axes (x right, y down, z forward).
  static PublishItem at(int frame, const Vec3d& p_m, const Vec3d& turn_rad = {}) {
    PublishItem item;
    item.result.captured.ns = 1'000'000'000 + frame * kPeriod_ns;
    item.result.sequence = static_cast<uint32_t>(frame);
    item.result.T_map_cam = Se3d{exp(Twistd{{}, turn_rad}).rotation, p_m};
    return item;
  }

  Config config;
  UtcClock clock;
  RunState state;
};

TEST_F(Messages, TheFirstBodyPoseIsTheOriginOfLocal) {
  const PoseMessage pose = maker().pose(at(0, {}));
  for (const double x : pose.pos_m) EXPECT_NEAR(x, 0, 1e-9);
  EXPECT_NEAR(pose.orientation_wxyz[0], 1, 1e-9);
  for (const double a : pose.accel_m_s2) EXPECT_TRUE(std::isnan(a));
}

TEST_F(Messages, ForwardOfTheCameraIsXOfTheBodyAndDownIsMinusZ) {
  const PoseMessage pose = maker().pose(at(1, {0.1, 0.2, 0.7}));  // right, down, forward
  EXPECT_NEAR(pose.pos_m[0], 0.7, 1e-6);
  EXPECT_NEAR(pose.pos_m[1], -0.1, 1e-6);
  EXPECT_NEAR(pose.pos_m[2], -0.2, 1e-6);
}

TEST_F(Messages, VelocityIsTheWayFromPoseToPose) {
  MessageMaker m = maker();
  m.pose(at(0, {}));
  const double dt_s = static_cast<double>(kPeriod_ns) * 1e-9;
  const PoseMessage pose = m.pose(at(1, {0, 0, 0.5 * dt_s}, {0, -0.3 * dt_s, 0}));  // turns left about its y
  EXPECT_NEAR(pose.vel_m_s[0], 0.5, 1e-6);
  EXPECT_NEAR(pose.vel_m_s[1], 0, 1e-6);
  EXPECT_NEAR(pose.rotation_rate_rad_s[2], 0.3, 1e-4);
}

TEST_F(Messages, AfterADiscontinuityThereIsNoVelocity) {
  MessageMaker m = maker();
  m.pose(at(0, {}));
  PublishItem item = at(1, {0, 0, 2});
  item.pose_epoch = 1;
  const PoseMessage pose = m.pose(item);
  for (const double v : pose.vel_m_s) EXPECT_EQ(v, 0);
}

TEST_F(Messages, TheMountTiltsLocal) {
  config.mount.initial_rp_deg = {0, 10};  // looks down by 10 degrees: forward leads down
  const PoseMessage pose = maker().pose(at(1, {0, 0, 1}));
  EXPECT_NEAR(pose.pos_m[0], std::cos(10 * kRad), 1e-6);
  EXPECT_NEAR(pose.pos_m[2], -std::sin(10 * kRad), 1e-6);
}

TEST_F(Messages, StampsAreUtcOfTheCapture) {
  const int64_t now_ns = monotonic_ns();
  PublishItem item = at(0, {});
  item.result.captured.ns = now_ns;
  EXPECT_LT(std::abs(maker().pose(item).utime.us - wall_ns() / 1000), 100'000);
}

TEST_F(Messages, AStatusCarriesTheFrameAndTheCounters) {
  state.frames_dropped = 7;
  state.faults.hold(Fault::map_full, 5);
  PublishItem item = at(3, {});
  item.result.state = TrackingState::poor;
  item.result.inlier_ratio = 0.25f;
  item.result.ms.total_ms = 12;
  item.map_id = 99;
  const StatusMessage status = maker().status(item, 20.0f);
  EXPECT_EQ(status.frame, 3u);
  EXPECT_EQ(status.state, 1);
  EXPECT_EQ(status.inlier_ratio, 0.25f);
  EXPECT_EQ(status.total_ms, 12);
  EXPECT_EQ(status.pose_age_ms, 20.0f);
  EXPECT_EQ(status.frames_dropped, 7u);
  EXPECT_EQ(status.map_id, 99u);
  EXPECT_EQ(status.fault_count[static_cast<size_t>(Fault::map_full)], 1u);
  EXPECT_EQ(status.faults_active, uint64_t{1} << static_cast<uint32_t>(Fault::map_full));
}

TEST(Covariance, MovesWithTheAxes) {
  // A turn by 90 degrees about z, and 2 m along x: the uncertainty of yaw becomes one along y as well.
  const Se3d T{exp(Twistd{{}, {0, 0, 90 * kRad}}).rotation, {2, 0, 0}};
  float from[21] = {}, to[21];
  from[0] = 4;   // x x
  from[20] = 1;  // rz rz
  transform_covariance(T, from, to);
  EXPECT_NEAR(to[0], 0, 1e-5);      // x x: what was y y
  EXPECT_NEAR(to[6], 4 + 4, 1e-5);  // y y: what was x x, and the arm of 2 m
  EXPECT_NEAR(to[20], 1, 1e-5);
  EXPECT_NEAR(std::abs(to[10]), 2, 1e-5);  // y rz
}

}  // namespace
}  // namespace stillmap
