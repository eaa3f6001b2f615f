#include "kernels/prepare/prepare_pixel.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "kernels/backend/cpu/loops.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::TestImage;

TEST(MetresFromRaw, NoMeasurementAndTooNearAreZero) {
  EXPECT_EQ(metres_from_raw(0, 0.001f, 0.1f), 0.0f);
  EXPECT_EQ(metres_from_raw(65535, 0.001f, 0.1f), 0.0f);
  EXPECT_EQ(metres_from_raw(99, 0.001f, 0.1f), 0.0f);
  EXPECT_FLOAT_EQ(metres_from_raw(100, 0.001f, 0.1f), 0.1f);
  EXPECT_FLOAT_EQ(metres_from_raw(5000, 1.0f / 5000, 0.1f), 1.0f);
  EXPECT_FLOAT_EQ(metres_from_raw(65534, 0.001f, 0.1f), 65.534f);  // far ones stay: they show free space
}

TEST(DepthBias, IsTakenOutBeforeTheRangeIsLookedAt) {
  const DepthBias bias{{0.01f, 1.02f, -0.004f, 0.001f}};
  EXPECT_FALSE(bias.none());
  EXPECT_TRUE(DepthBias{}.none());
  const auto polynomial = [](float m) { return 0.01f + 1.02f * m - 0.004f * m * m + 0.001f * m * m * m; };
  for (const uint16_t raw : std::initializer_list<uint16_t>{500, 1000, 2500, 4000})
    EXPECT_FLOAT_EQ(metres_from_raw(raw, 0.001f, 0.1f, bias, 4.0f), polynomial(0.001f * raw));
  EXPECT_EQ(metres_from_raw(0, 0.001f, 0.1f, bias, 4.0f), 0.0f) << "not the offset";
  EXPECT_EQ(metres_from_raw(65535, 0.001f, 0.1f, bias, 4.0f), 0.0f);
  EXPECT_EQ(metres_from_raw(80, 0.001f, 0.1f, bias, 4.0f), 0.0f) << "0.09 m";
  EXPECT_GT(metres_from_raw(95, 0.001f, 0.1f, bias, 4.0f), 0.1f);
  // Beyond what it was fitted to the difference stays what it is there.
  EXPECT_FLOAT_EQ(metres_from_raw(60000, 0.001f, 0.1f, bias, 4.0f), 60.0f + polynomial(4.0f) - 4.0f);
  EXPECT_EQ(metres_from_raw(1000, 0.001f, 0.1f, DepthBias{{NAN, 1, 0, 0}}, 4.0f), 0.0f);
}

TEST(Bilinear, BlendsNeighboursAndIsBlackOutside) {
  TestImage<Rgb8> image(2, 3);
  image.view().at(0, 0) = {0, 100, 10};
  image.view().at(0, 1) = {100, 100, 20};
  image.view().at(1, 0) = {50, 100, 30};
  image.view().at(1, 1) = {150, 100, 40};
  image.view().at(0, 2) = image.view().at(1, 2) = {255, 255, 255};
  const ImageView<const Rgb8> v = image.view();
  const auto expect = [&](Pixel at, int r, int g, int b) {
    const Rgb8 c = bilinear(v, at);
    EXPECT_EQ(c.r, r) << at.u << " " << at.v;
    EXPECT_EQ(c.g, g) << at.u << " " << at.v;
    EXPECT_EQ(c.b, b) << at.u << " " << at.v;
  };
  expect({0, 0}, 0, 100, 10);
  expect({0.5f, 0}, 50, 100, 15);
  expect({0, 0.5f}, 25, 100, 20);
  expect({0.5f, 0.5f}, 75, 100, 25);
  expect({0.25f, 0.75f}, 63, 100, 28);  // 62.5 and 27.5, rounded up
  expect({2, 1}, 255, 255, 255);        // the last pixel has no neighbours behind it
  expect({-0.01f, 0}, 0, 0, 0);
  expect({2.01f, 0}, 0, 0, 0);
  expect({0, 1.01f}, 0, 0, 0);
  expect({NAN, 0}, 0, 0, 0);
}

/// Images around one run of the pass.
struct Prepared {
  TestImage<uint16_t> depth_raw;
  TestImage<Rgb8> colour_raw;
  TestImage<float> depth_m;
  TestImage<LumaChroma> luma;
  TestImage<Rgb8> colour;
  TestImage<Pixel> source;

  Prepared(int32_t rows, int32_t cols)
      : depth_raw(rows, cols, 3),
        colour_raw(rows, cols, 1),
        depth_m(rows, cols),
        luma(rows, cols),
        colour(rows, cols),
        source(rows, cols) {}

  PreparePass pass(bool undistort) {
    PreparePass p{depth_raw.view(),
                  colour_raw.view(),
                  depth_m.view(),
                  luma.view(),
                  colour.view(),
                  {},
                  0.001f,
                  0.1f,
                  5.0f};
    if (undistort) p.source_pixel = source.view();
    return p;
  }
};

TEST(Prepare, WritesMetresLumaAndCountsWhatIsInRange) {
  constexpr int32_t kCols = 20;  // twice eight at a time, and a rest
  Prepared images(2, kCols);
  const uint16_t raw[2][4] = {{0, 65535, 50, 100}, {1234, 5000, 5001, 60000}};
  const float metres[2][4] = {{0, 0, 0, 0.1f}, {1.234f, 5.0f, 5.001f, 60.0f}};
  for (int32_t r = 0; r < 2; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      images.depth_raw.view().at(r, c) = raw[r][c % 4];
      images.colour_raw.view().at(r, c) = {static_cast<uint8_t>(60 * c), static_cast<uint8_t>(100 * r), 7};
    }
  for (const CpuLoops* loops : runnable_loops()) {
    EXPECT_EQ(loops->prepare(images.pass(false), 0, 2), 15);
    for (int32_t r = 0; r < 2; ++r)
      for (int32_t c = 0; c < kCols; ++c) {
        EXPECT_FLOAT_EQ(images.depth_m.view().at(r, c), metres[r][c % 4]);
        const Rgb8 in = images.colour_raw.view().at(r, c), out = images.colour.view().at(r, c);
        EXPECT_EQ(in.r, out.r);
        EXPECT_EQ(in.g, out.g);
        const LumaChroma plain = luma_chroma(in), got = images.luma.view().at(r, c);
        EXPECT_EQ(got.luma, plain.luma) << loops->name;
        EXPECT_EQ(got.cb, plain.cb);
        EXPECT_EQ(got.cr, plain.cr);
      }
  }
  EXPECT_EQ(kLoopsBaseline.prepare(images.pass(false), 1, 2), 10);  // rows [first, last)
}

TEST(Prepare, TakesTheBiasOutWithAndWithoutALens) {
  constexpr int32_t kCols = 20;
  Prepared images(2, kCols);
  for (int32_t r = 0; r < 2; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      images.depth_raw.view().at(r, c) = static_cast<uint16_t>(c == 3 ? 0 : 4700 + 50 * c);
      images.source.view().at(r, c) = {static_cast<float>(c), static_cast<float>(r)};
    }
  for (const CpuLoops* loops : runnable_loops())
    for (const bool undistort : {false, true}) {
      PreparePass pass = images.pass(undistort);
      pass.bias = {{-0.02f, 1.01f, 0, 0}};
      pass.biased = true;
      // 4.7 m and more; 5 m are reached from 0.98 + ... = 4970.3 units on: columns 0 to 5 but one.
      EXPECT_EQ(loops->prepare(pass, 0, 2), 2 * 5) << loops->name;
      for (int32_t r = 0; r < 2; ++r)
        for (int32_t c = 0; c < kCols; ++c) {
          const uint16_t raw = images.depth_raw.view().at(r, c);
          EXPECT_FLOAT_EQ(images.depth_m.view().at(r, c),
                          raw == 0 ? 0.0f : metres_from_raw(raw, 0.001f, 0.1f, pass.bias, 5.0f));
        }
      EXPECT_NEAR(images.depth_m.view().at(0, 0), 4.727f, 1e-5f);
      // One that is nothing changes nothing, to the last bit.
      pass.bias = {};
      loops->prepare(pass, 0, 2);
      for (int32_t c = 0; c < kCols; ++c)
        EXPECT_EQ(images.depth_m.view().at(1, c),
                  metres_from_raw(images.depth_raw.view().at(1, c), 0.001f, 0.1f));
    }
}

// A checker of two depths seen through a strong lens: whatever comes out is one of the two, and the nearest.
TEST(Prepare, UndistortedDepthIsTheNearestNeverABlend) {
  constexpr int32_t kRows = 60, kCols = 80;
  Prepared images(kRows, kCols);
  const CameraModel camera = {{60, 60, 39.5f, 29.5f, kCols, kRows}, {0.25f, -0.3f, 0.004f, -0.003f, 0.1f}};
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      images.depth_raw.view().at(r, c) = (r / 3 + c / 3) % 2 ? 1000 : 3000;
      images.source.view().at(r, c) = distort(camera, {static_cast<float>(c), static_cast<float>(r)});
    }
  for (const CpuLoops* loops : runnable_loops()) {
    const int32_t in_range = loops->prepare(images.pass(true), 0, kRows);
    int32_t seen = 0, moved = 0;
    for (int32_t r = 0; r < kRows; ++r)
      for (int32_t c = 0; c < kCols; ++c) {
        const Pixel p = images.source.view().at(r, c);
        const auto sr = static_cast<int32_t>(std::lround(p.v)), sc = static_cast<int32_t>(std::lround(p.u));
        const bool inside = sr >= 0 && sr < kRows && sc >= 0 && sc < kCols;
        const float z_m = images.depth_m.view().at(r, c);
        const float expected_m = !inside ? 0.0f : (sr / 3 + sc / 3) % 2 ? 1.0f : 3.0f;
        EXPECT_NEAR(z_m, expected_m, 1e-6f) << r << " " << c;
        seen += inside;
        moved += inside && (sr != r || sc != c);
      }
    EXPECT_EQ(in_range, seen);
    EXPECT_GT(moved, kRows * kCols / 4);  // the lens does something
    EXPECT_LT(seen, kRows * kCols);       // and some pixels lie outside of the raw image
  }
}

}  // namespace
}  // namespace stillmap
