#include "drivers/camera/depth_registration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <vector>

#include "kernels/backend/cpu/loops.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using Depth = test::TestImage<uint16_t>;

constexpr int32_t kRows = 48, kCols = 64;
constexpr float kUnits = 5000;
constexpr uint16_t kMetre = 5000;

CameraModel camera(float f = 60) {
  return {{f, f, 31.5f, 23.5f, kCols, kRows}, {}};
}

Depth filled(uint16_t raw) {
  Depth image(kRows, kCols);
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) image.view().at(r, c) = raw;
  return image;
}

Depth registered(const Depth& raw, const DepthCamera& depth, const CameraModel& colour) {
  Depth out = filled(1234);  // what was there before does not matter
  DepthRegistration(depth, colour, kUnits).run(raw.view(), out.view());
  return out;
}

TEST(DepthRegistration, OfOneAndTheSameCameraIsTheSameImage) {
  Depth raw = test::depth_pattern(kRows, kCols, 3);
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c)
      raw.view().at(r, c) = static_cast<uint16_t>(raw.view().at(r, c) | 256);
  raw.view().at(5, 6) = 0;
  raw.view().at(5, 7) = 65535;
  const Depth out = registered(raw, {camera(), {}}, camera());
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      const uint16_t in = raw.view().at(r, c);
      ASSERT_EQ(out.view().at(r, c), in == 65535 ? 0 : in) << r << " " << c;
    }
}

// A wall at 2 m, the depth camera 10 cm to the left: it moves by f b / z = 3 pixels, and a strip stays
// unknown.
TEST(DepthRegistration, AWallMovesByTheDisparity) {
  DepthCamera depth{camera(), {}};
  depth.T_colour_depth.translation = {-0.1, 0, 0};
  const Depth out = registered(filled(2 * kMetre), depth, camera());
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c)
      ASSERT_EQ(out.view().at(r, c), c < kCols - 3 ? 2 * kMetre : 0) << r << " " << c;
}

TEST(DepthRegistration, DepthIsThatFromTheColourCamera) {
  DepthCamera depth{camera(), {}};
  depth.T_colour_depth.translation = {0, 0, 0.05};
  const Depth out = registered(filled(2 * kMetre), depth, camera());
  EXPECT_EQ(out.view().at(24, 32), 2 * kMetre + kMetre / 20);
  EXPECT_EQ(out.view().at(0, 0), 0) << "from farther back the wall is smaller";
}

// The nearer of two things that fall on one pixel hides the other, whichever is looked at first.
TEST(DepthRegistration, TheNearestStays) {
  for (const double side : {-1.0, 1.0}) {
    Depth raw = filled(3 * kMetre);
    for (int32_t r = 20; r < 28; ++r)
      for (int32_t c = 28; c < 36; ++c) raw.view().at(r, c) = kMetre;
    DepthCamera depth{camera(), {}};
    depth.T_colour_depth.translation = {side * 0.1, 0, 0};  // 6 pixels at 1 m, 2 at 3 m
    const Depth out = registered(raw, depth, camera());
    const auto shift = static_cast<int32_t>(6 * side);
    for (int32_t r = 20; r < 28; ++r)
      for (int32_t c = 28; c < 36; ++c) ASSERT_EQ(out.view().at(r, c + shift), kMetre);
    int32_t near = 0, hidden = 0;
    for (int32_t c = 4; c < kCols - 4; ++c) {
      near += out.view().at(24, c) == kMetre;
      hidden += out.view().at(24, c) == 0;
    }
    EXPECT_EQ(near, 8);
    EXPECT_EQ(hidden, 4) << "what only the colour camera sees";
  }
}

// A longer lens sees the same with more pixels: no holes, all of the wall; a shorter one leaves the rim
// empty.
TEST(DepthRegistration, OtherFocalLengthsLeaveNoHoles) {
  const Depth larger = registered(filled(kMetre), {camera(60), {}}, camera(87));
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) ASSERT_EQ(larger.view().at(r, c), kMetre) << r << " " << c;
  const Depth smaller = registered(filled(kMetre), {camera(60), {}}, camera(41));
  int32_t seen = 0;
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) seen += smaller.view().at(r, c) == kMetre;
  EXPECT_NEAR(seen, kRows * kCols * (41.0 / 60) * (41.0 / 60), 60);
  EXPECT_EQ(smaller.view().at(24, 32), kMetre);
}

// A tilted camera: each registered pixel lies on the plane that the depth camera saw.
TEST(DepthRegistration, ATurnedCameraSeesTheSamePlane) {
  DepthCamera depth{camera(), {}};
  const double angle = 0.1;
  depth.T_colour_depth = exp(Twistd{{0.03, -0.02, 0.01}, {0, angle, 0}});
  const Depth out = registered(filled(2 * kMetre), depth, camera());
  // In the depth camera z = 2 m; in the colour camera n . p = d.
  const Vec3d n = depth.T_colour_depth.rotation * Vec3d{0, 0, 1};
  const double d = 2 + dot(n, depth.T_colour_depth.translation);
  int32_t seen = 0;
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      const uint16_t raw = out.view().at(r, c);
      if (raw == 0) continue;
      ++seen;
      const Vec3 ray = unproject(camera().k, static_cast<float>(c), static_cast<float>(r), 1.0f);
      const double z_m = d / dot(n, Vec3d{static_cast<double>(ray.x), static_cast<double>(ray.y), 1});
      // A pixel's depth is that of the ray that fell into it: half a pixel off on a slope of a tenth.
      ASSERT_NEAR(raw / static_cast<double>(kUnits), z_m, 2 * 0.11 / 60) << r << " " << c;
    }
  EXPECT_GT(seen, kRows * kCols * 8 / 10);
}

// Lenses: the depth camera's distortion is taken out, the colour camera's is put in.
TEST(DepthRegistration, GoesThroughBothLenses) {
  CameraModel bent = camera();
  bent.distortion = {-0.2f, 0.05f, 0, 0, 0};
  const Depth same = registered(filled(kMetre), {bent, {}}, bent);
  for (int32_t r = 1; r < kRows - 1; ++r)
    for (int32_t c = 1; c < kCols - 1; ++c) ASSERT_EQ(same.view().at(r, c), kMetre);
  // One measured pixel comes out where the ideal one is seen by the other lens.
  Depth one = filled(0);
  one.view().at(8, 10) = kMetre;
  const Pixel ideal = {10, 8};
  const Pixel seen = distort(bent, ideal);
  const Depth moved = registered(one, {camera(), {}}, bent);
  EXPECT_EQ(
      moved.view().at(static_cast<int32_t>(std::lround(seen.v)), static_cast<int32_t>(std::lround(seen.u))),
      kMetre);
}

// One source, several instruction sets; neither the width of the images nor their pitch is a whole number of
// lanes.
TEST(DepthRegistration, EveryInstructionSetSaysTheSame) {
  constexpr int32_t kNarrow = kCols - 5;
  DepthCamera depth{camera(), exp(Twistd{{0.03, -0.02, 0.01}, {0.02, 0.03, -0.05}})};
  CameraModel colour = camera(71);
  depth.model.k.width = colour.k.width = kNarrow;
  const Depth raw = test::depth_pattern(kRows, kCols, 3);
  for (const float k1 : {0.0f, -0.1f}) {
    colour.distortion.k1 = k1;
    const auto run = [&](const CpuLoops* loops) {
      Depth out = filled(1234);
      DepthRegistration(depth, colour, kUnits, loops)
          .run({raw.view().data, kRows, kNarrow, kCols}, {out.view().data, kRows, kNarrow, kCols});
      return out;
    };
    const Depth expected = run(&kLoopsBaseline);
    int32_t covered = 0;
    for (const CpuLoops* loops : runnable_loops()) {
      const Depth out = run(loops);
      int32_t other = 0;
      for (int32_t r = 0; r < kRows; ++r) {
        for (int32_t c = 0; c < kNarrow; ++c) {
          other += std::abs(out.view().at(r, c) - expected.view().at(r, c)) > 1;
          covered += out.view().at(r, c) != 0;
        }
        for (int32_t c = kNarrow; c < kCols; ++c) ASSERT_EQ(out.view().at(r, c), 1234) << "beside the image";
      }
      EXPECT_LE(other, 5) << loops->name << ": a pixel may fall to the other side of an edge";
    }
    EXPECT_GT(covered, kRows * kNarrow / 2 * static_cast<int32_t>(runnable_loops().size));
  }
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
double thread_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

// 640x480; what docs/RESULTS.md says it takes is printed here. The bound is loose: it is for a slip in the
// loops.
TEST(DepthRegistration, TakesASmallShareOfAFrame) {
  constexpr int32_t kRuns = 31;
  DepthCamera depth{{{570, 570, 319.5f, 239.5f, 640, 480}, {}}, exp(Twistd{{0.025, 0, 0}, {0.002, 0, 0}})};
  const CameraModel colour{{525, 525, 319.5f, 239.5f, 640, 480}, {}};
  Depth raw(480, 640), out(480, 640);
  for (int32_t r = 0; r < 480; ++r)
    for (int32_t c = 0; c < 640; ++c)
      raw.view().at(r, c) = static_cast<uint16_t>((c / 80 + r / 80) % 9 ? 1500 + 100 * (c / 80) + r : 0);
  const DepthRegistration registration(depth, colour, 1000);
  std::vector<double> ms;
  for (int32_t i = 0; i < kRuns; ++i) {
    const double start_ms = thread_ms();
    registration.run(raw.view(), out.view());
    ms.push_back(thread_ms() - start_ms);
  }
  std::sort(ms.begin(), ms.end());
  std::printf("640x480: median %.2f ms of the thread's time, best %.2f\n", ms[kRuns / 2], ms[0]);
  EXPECT_LT(ms[kRuns / 2], 20);
}
#endif

TEST(DepthRegistration, WhatLiesBehindOrTooFarIsLeftOut) {
  DepthCamera depth{camera(), {}};
  depth.T_colour_depth.translation = {0, 0, -1.5};  // the wall at 1 m is behind the colour camera
  const Depth behind = registered(filled(kMetre), depth, camera());
  depth.T_colour_depth.translation = {0, 0, 13.0};  // 14 m are more than 16 bits hold
  const Depth far = registered(filled(kMetre), depth, camera());
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      ASSERT_EQ(behind.view().at(r, c), 0);
      ASSERT_EQ(far.view().at(r, c), 0);
    }
}

}  // namespace
}  // namespace stillmap
