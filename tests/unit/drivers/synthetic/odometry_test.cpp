#include "drivers/synthetic/odometry.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "drivers/synthetic/synthetic_source.hpp"

namespace stillmap::synthetic {
namespace {

Stamp at_s(double seconds) {
  return {std::llround(seconds * 1e9)};
}

Se3d body(const Scene& scene, double t_s) {
  Se3d T = scene.camera(t_s);
  T.rotation = T.rotation * transposed(Mat3T<double>{{0, 0, 1, -1, 0, 0, 0, -1, 0}});
  return T;
}

/// Largest error of place over half a second, metres, per metre gone.
double worst_error(const Scene& scene, bool slips) {
  WheelOdometry odometry(scene, 3, slips);
  double worst = 0;
  for (double t = 0.5; t < 12.0; t += 0.5) {
    OdometrySample a, b;
    EXPECT_EQ(odometry.at(at_s(t), b), Status::ok);
    EXPECT_EQ(odometry.at(at_s(t - 0.5), a), Status::ok);
    EXPECT_EQ(b.stamp, at_s(t));
    const Se3d measured = inverse(a.T_odom_body) * b.T_odom_body;
    const Se3d truth = inverse(body(scene, t - 0.5)) * body(scene, t);
    double way_m = 0;
    for (double s = t - 0.5; s < t; s += 0.02)
      way_m += norm(scene.camera(s + 0.02).translation - scene.camera(s).translation);
    worst = std::max(worst, norm(measured.translation - truth.translation) / std::max(way_m, 0.05));
  }
  return worst;
}

TEST(WheelOdometry, ErrsByAFewPercentAndMuchMoreWhenWheelsSlip) {
  const Scene& scene = *find_scene("loop");
  const double good = worst_error(scene, false), slipping = worst_error(scene, true);
  EXPECT_GT(good, 0.002);
  EXPECT_LT(good, 0.2);
  EXPECT_GT(slipping, 0.5);
}

TEST(WheelOdometry, KnowsNothingOfTheFuture) {
  WheelOdometry odometry(*find_scene("static"), 1, false);
  OdometrySample sample;
  ASSERT_EQ(odometry.at(at_s(1.01), sample), Status::ok);
  EXPECT_EQ(sample.stamp, at_s(1.0));
  ASSERT_EQ(odometry.at(at_s(1.04), sample), Status::ok);
  ASSERT_EQ(odometry.at(at_s(1.01), sample), Status::ok);
  EXPECT_EQ(sample.stamp, at_s(1.01));
}

TEST(WheelOdometry, TheSeedDecidesAndLongSkipsAreBounded) {
  const Scene& scene = *find_scene("loop");
  WheelOdometry a(scene, 1, false), same(scene, 1, false), other(scene, 2, false), late(scene, 1, false);
  OdometrySample from_a, from_same, from_other;
  ASSERT_EQ(a.at(at_s(4), from_a), Status::ok);
  ASSERT_EQ(same.at(at_s(2), from_same), Status::ok);
  ASSERT_EQ(same.at(at_s(4), from_same), Status::ok);
  ASSERT_EQ(other.at(at_s(4), from_other), Status::ok);
  EXPECT_EQ(from_a.T_odom_body.translation.x, from_same.T_odom_body.translation.x);
  EXPECT_NE(from_a.T_odom_body.translation.x, from_other.T_odom_body.translation.x);
  EXPECT_EQ(late.at(at_s(90000), from_a), Status::ok);
  EXPECT_EQ(late.at(at_s(90000 - 4), from_a), Status::ok);
  EXPECT_EQ(late.at(at_s(90000 - 20), from_a), Status::timeout);
}

TEST(WheelOdometry, ComesWithTheSourceOnlyWhenAskedFor) {
  for (const auto& [spec, there] : {std::pair{"static,size=64x48", false},
                                    {"static,size=64x48,odometry=0", false},
                                    {"static,size=64x48,odometry=1", true},
                                    {"static,size=64x48,odometry=slip", true}}) {
    const auto source = open_synthetic(spec, 1);
    ASSERT_TRUE(source) << spec;
    EXPECT_EQ((*source)->odometry() != nullptr, there) << spec;
  }
  EXPECT_FALSE(open_synthetic("static,odometry=2", 1));
}

}  // namespace
}  // namespace stillmap::synthetic
