#include "kernels/base/pinhole.hpp"

#include <gtest/gtest.h>

#include <random>

namespace stillmap {
namespace {

const CameraModel kFreiburg1 = {{517.306408f, 516.469215f, 318.643040f, 255.313989f, 640, 480},
                                {0.262383f, -0.953104f, -0.005358f, 0.002628f, 1.163314f}};

TEST(Pinhole, ProjectUndoesUnproject) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> u(-50, 700), v(-50, 500), z(0.1f, 10);
  for (int i = 0; i < 2000; ++i) {
    const Pixel p = {u(random), v(random)};
    const float z_m = z(random);
    const Vec3 p_cam = unproject(kFreiburg1.k, p.u, p.v, z_m);
    EXPECT_EQ(p_cam.z, z_m);
    const Pixel back = project(kFreiburg1.k, p_cam);
    EXPECT_NEAR(back.u, p.u, 1e-3f);
    EXPECT_NEAR(back.v, p.v, 1e-3f);
  }
}

TEST(Pinhole, UnprojectIsTheEquationOfThePaper) {
  const Intrinsics k = {500, 400, 300, 200, 640, 480};
  const Vec3 p = unproject(k, 350, 100, 2);
  EXPECT_FLOAT_EQ(p.x, 0.2f);
  EXPECT_FLOAT_EQ(p.y, -0.5f);
  EXPECT_FLOAT_EQ(p.z, 2.0f);
}

TEST(Pinhole, NoDistortionMovesNothing) {
  const CameraModel ideal = {kFreiburg1.k, {}};
  EXPECT_TRUE(ideal.distortion.none());
  EXPECT_FALSE(kFreiburg1.distortion.none());
  const Pixel p = distort(ideal, {12.5f, 470.25f});
  EXPECT_NEAR(p.u, 12.5f, 1e-4f);
  EXPECT_NEAR(p.v, 470.25f, 1e-4f);
}

// By hand, with the coefficients of TUM freiburg1. At x = 0.5, y = -0.4: r2 = 0.41,
// radial = 1 + 0.41 (0.262383 + 0.41 (-0.953104 + 0.41 * 1.163314)) = 1.0275370
TEST(Pinhole, DistortsFreiburg1AsComputedByHand) {
  const double x = 0.5, y = -0.4, r2 = 0.41;
  const double radial = 1 + r2 * 0.262383 - r2 * r2 * 0.953104 + r2 * r2 * r2 * 1.163314;
  EXPECT_NEAR(radial, 1.0275370118, 1e-9);
  const double xd = x * radial + 2 * -0.005358 * x * y + 0.002628 * (r2 + 2 * x * x);
  const double yd = y * radial + -0.005358 * (r2 + 2 * y * y) + 2 * 0.002628 * x * y;
  EXPECT_NEAR(xd, 0.5183031859, 1e-9);
  EXPECT_NEAR(yd, -0.4159773447, 1e-9);
  const Intrinsics& k = kFreiburg1.k;
  const Pixel ideal = {k.fx * 0.5f + k.cx, k.fy * -0.4f + k.cy};
  const Pixel p = distort(kFreiburg1, ideal);
  EXPECT_NEAR(p.u, 517.306408 * xd + 318.643040, 1e-3);
  EXPECT_NEAR(p.v, 516.469215 * yd + 255.313989, 1e-3);
}

TEST(Pinhole, DistortionLeavesThePrincipalPoint) {
  const Pixel p = distort(kFreiburg1, {kFreiburg1.k.cx, kFreiburg1.k.cy});
  EXPECT_FLOAT_EQ(p.u, kFreiburg1.k.cx);
  EXPECT_FLOAT_EQ(p.v, kFreiburg1.k.cy);
}

TEST(Pinhole, SubsampledCameraSeesEveryNthPixelWhereItWas) {
  for (const int32_t step : {1, 2, 4}) {
    const Intrinsics s = subsampled(kFreiburg1.k, step);
    EXPECT_EQ(s.width, (640 + step - 1) / step);
    const Vec3 p_cam = unproject(kFreiburg1.k, 200, 120, 1.5f);
    const Pixel p = project(s, p_cam);
    EXPECT_NEAR(p.u * static_cast<float>(step), 200, 1e-3f);
    EXPECT_NEAR(p.v * static_cast<float>(step), 120, 1e-3f);
  }
  EXPECT_EQ(subsampled({1, 1, 0, 0, 641, 479}, 4).width, 161);
  EXPECT_EQ(subsampled({1, 1, 0, 0, 641, 479}, 4).height, 120);
}

}  // namespace
}  // namespace stillmap
