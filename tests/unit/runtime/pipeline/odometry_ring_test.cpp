#include "runtime/ports/odometry_ring.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

OdometrySample sample_at(int64_t ns, double x, double yaw = 0) {
  OdometrySample sample{{ns}, exp(Twistd{{}, {0, 0, yaw}})};
  sample.T_odom_body.translation = {x, 0, 0};
  return sample;
}

TEST(OdometryRing, IsSilentWhileEmptyAndBeforeItsFirstSample) {
  OdometryRing ring;
  OdometrySample out;
  EXPECT_EQ(ring.at({100}, out), Status::timeout);
  EXPECT_TRUE(ring.push(sample_at(100, 1)));
  EXPECT_EQ(ring.at({99}, out), Status::timeout);
  EXPECT_EQ(ring.at({100}, out), Status::ok);
}

TEST(OdometryRing, InterpolatesBetweenSamplesAndHoldsTheLast) {
  OdometryRing ring;
  ring.push(sample_at(100, 1));
  ring.push(sample_at(200, 2, 0.4));
  OdometrySample out;
  ASSERT_EQ(ring.at({125}, out), Status::ok);
  EXPECT_EQ(out.stamp.ns, 125);
  EXPECT_NEAR(log_rotation(out.T_odom_body.rotation).z, 0.1, 1e-12);
  EXPECT_NEAR(out.T_odom_body.translation.x, 1.25, 0.02);
  ASSERT_EQ(ring.at({5000}, out), Status::ok);
  EXPECT_EQ(out.stamp.ns, 200);
  EXPECT_EQ(out.T_odom_body.translation.x, 2);
}

TEST(OdometryRing, RefusesWhatIsNotLater) {
  OdometryRing ring;
  ring.push(sample_at(100, 1));
  EXPECT_FALSE(ring.push(sample_at(100, 5)));
  EXPECT_FALSE(ring.push(sample_at(50, 5)));
  EXPECT_EQ(ring.count(), 1u);
  OdometrySample out;
  ASSERT_EQ(ring.at({100}, out), Status::ok);
  EXPECT_EQ(out.T_odom_body.translation.x, 1);
}

TEST(OdometryRing, ForgetsTheOldest) {
  OdometryRing ring;
  const auto more = static_cast<int64_t>(OdometryRing::kSamples) + 10;
  for (int64_t i = 0; i < more; ++i) ring.push(sample_at(i * 10, static_cast<double>(i)));
  OdometrySample out;
  EXPECT_EQ(ring.at({9 * 10}, out), Status::timeout);
  ASSERT_EQ(ring.at({10 * 10}, out), Status::ok);
  EXPECT_EQ(out.T_odom_body.translation.x, 10);
  ring.clear();
  EXPECT_EQ(ring.at({10 * 10}, out), Status::timeout);
}

}  // namespace
}  // namespace stillmap
