#include "kernels/complete/near_echo.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stillmap {
namespace {

constexpr float kDegree = 3.14159265f / 180.0f;

/// 4 cm above the lens, looks along the optical axis, 30 degrees wide.
NearEcho echo_at(float range_m) {
  NearEcho echo;
  echo.place_cam = {0, -0.04f, 0};
  echo.axis_cam = {0, 0, 1};
  echo.cos_half_beam = std::cos(15.0f * kDegree);
  echo.range_m = range_m;
  echo.until_m = 0.5f;
  return echo;
}
/// The ray from the camera to where the sonar sees `range_m` away, so far off its axis, upwards.
Vec3 ray_to(float range_m, float degrees_up) {
  return {0, -0.04f - range_m * std::sin(degrees_up * kDegree), range_m * std::cos(degrees_up * kDegree)};
}

TEST(NearEcho, WithoutAReadingNothingIsHeard) {
  EXPECT_FALSE(NearEcho{}.may_be_on({0, 0, 1}));
}

TEST(NearEcho, TheRaysThroughItsConeAreThoseThatMeetItFromTheCamera) {
  const NearEcho echo = echo_at(0.2f);
  for (const float range_m : {0.2f, 0.5f}) {
    EXPECT_TRUE(echo.may_be_on(ray_to(range_m, 0))) << range_m;
    EXPECT_TRUE(echo.may_be_on(ray_to(range_m, 14))) << range_m;
    EXPECT_TRUE(echo.may_be_on(ray_to(range_m, -14))) << range_m;
    EXPECT_TRUE(echo.may_be_on(3.0f * ray_to(range_m, 14))) << "any length";
  }
  // Upwards the rim is met 20 cm away, where the parallax is largest; downwards at 50 cm.
  EXPECT_FALSE(echo.may_be_on(ray_to(0.2f, 17)));
  EXPECT_FALSE(echo.may_be_on(ray_to(0.5f, -17)));
  EXPECT_FALSE(echo.may_be_on({0.5f, 0, 1}));
  EXPECT_FALSE(echo.may_be_on({0, 0, -1})) << "behind the camera";
}

TEST(NearEcho, NearerThanItsOwnPlaceTheDirectionDecides) {
  NearEcho echo = echo_at(0.03f);
  echo.until_m = 0.035f;
  EXPECT_TRUE(echo.may_be_on({0, 0, 1}));
  EXPECT_TRUE(echo.may_be_on({0.2f, 0, 1}));
  EXPECT_FALSE(echo.may_be_on({0.3f, 0, 1}));
}

TEST(NearEcho, ATurnedSonarHearsElsewhere) {
  NearEcho echo = echo_at(0.3f);
  echo.axis_cam = {std::sin(40.0f * kDegree), 0, std::cos(40.0f * kDegree)};
  EXPECT_FALSE(echo.may_be_on({0, 0, 1}));
  EXPECT_TRUE(echo.may_be_on({std::tan(40.0f * kDegree), 0, 1}));
}

}  // namespace
}  // namespace stillmap
