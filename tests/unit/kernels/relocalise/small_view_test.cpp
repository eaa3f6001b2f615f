#include "kernels/relocalise/small_view.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace stillmap {
namespace {

/// A frame of 8 x 8 pixels in cells of 4 x 4.
class SmallViewTest : public testing::Test {
 protected:
  static constexpr int32_t kSide = 8, kPx = 4;
  void shrink() {
    const ShrinkPass pass{{depth_m.data(), kSide, kSide, kSide},
                          {colour.data(), kSide, kSide, kSide},
                          {mask.data(), kSide, kSide, kSide},
                          kPx,
                          5.0f,
                          small};
    for (int32_t r = 0; r < 2; ++r)
      for (int32_t c = 0; c < 2; ++c) pass(r, c);
  }
  /// Sets the pixels of the first cell from the `first`-th on.
  template <class T>
  static void fill_cell(std::vector<T>& image, int32_t first, T value) {
    for (int32_t i = first; i < kPx * kPx; ++i) image[static_cast<size_t>(i / kPx * kSide + i % kPx)] = value;
  }
  std::vector<float> depth_m = std::vector<float>(kSide * kSide, 2.0f);
  std::vector<LumaChroma> colour = std::vector<LumaChroma>(kSide * kSide, LumaChroma{32640, 128, 128});
  std::vector<uint8_t> mask = std::vector<uint8_t>(kSide * kSide, 0);
  std::vector<float> out_depth = std::vector<float>(4, -5.0f), out_luma = out_depth;
  SmallView small{{out_depth.data(), 2, 2, 2}, {out_luma.data(), 2, 2, 2}};
};

TEST_F(SmallViewTest, ACellIsTheMeanOfItsPixels) {
  fill_cell(depth_m, 8, 2.1f);
  fill_cell(colour, 8, LumaChroma{0, 128, 128});
  shrink();
  EXPECT_NEAR(out_depth[0], 2.05f, 1e-5f);
  EXPECT_NEAR(out_luma[0], 0.25f, 1e-5f);
  EXPECT_NEAR(out_depth[3], 2.0f, 1e-5f);
  EXPECT_NEAR(out_luma[3], 0.5f, 1e-5f);
}

TEST_F(SmallViewTest, AnEdgeHasNoDepthButLuminance) {
  fill_cell(depth_m, 8, 3.0f);
  shrink();
  EXPECT_EQ(out_depth[0], 0.0f);
  EXPECT_NEAR(out_luma[0], 0.5f, 1e-5f);
}

TEST_F(SmallViewTest, MaskedAndUnmeasuredPixelsAreLeftOut) {
  fill_cell(depth_m, 8, 4.9f);
  fill_cell(mask, 8, uint8_t{255});
  shrink();
  EXPECT_NEAR(out_depth[0], 2.0f, 1e-5f);  // no edge: the other half is masked
  fill_cell(mask, 0, uint8_t{255});
  fill_cell(depth_m, 0, 0.0f);
  shrink();
  EXPECT_EQ(out_depth[0], 0.0f);
  EXPECT_EQ(out_luma[0], kNoLuma);
}

TEST_F(SmallViewTest, TooFewOrTooFarPixelsMakeNoCell) {
  fill_cell(depth_m, 3, 0.0f);
  shrink();
  EXPECT_EQ(out_depth[0], 0.0f);
  fill_cell(depth_m, 0, 5.5f);
  shrink();
  EXPECT_EQ(out_depth[0], 0.0f);
}

TEST_F(SmallViewTest, HalvingTakesTheMeanOfWhatIsThere) {
  out_depth = {2.0f, 0.0f, 2.1f, 2.2f};
  out_luma = {0.2f, kNoLuma, 0.4f, 0.6f};
  float depth = -1, luma = -1;
  const HalvePass halve{small, {{&depth, 1, 1, 1}, {&luma, 1, 1, 1}}};
  halve(0, 0);
  EXPECT_NEAR(depth, 2.1f, 1e-5f);
  EXPECT_NEAR(luma, 0.4f, 1e-5f);
  out_depth[3] = 3.0f;  // an edge
  halve(0, 0);
  EXPECT_EQ(depth, 0.0f);
}

TEST(SmallView, TheShrunkCameraSeesTheMiddleOfACell) {
  const Intrinsics k = {500, 500, 319.5f, 239.5f, 640, 480}, small = shrunk(k, cell_px(640));
  EXPECT_EQ(small.width, 80);
  EXPECT_EQ(small.height, 60);
  // The first cell covers the pixels 0 to 7, its middle is 3.5.
  const Vec3 middle = unproject(k, 3.5f, 3.5f, 2.0f);
  EXPECT_NEAR(project(small, middle).u, 0.0f, 1e-4f);
  EXPECT_NEAR(project(small, middle).v, 0.0f, 1e-4f);
  EXPECT_EQ(cell_px(64), 1);
  EXPECT_EQ(cell_px(81), 2);
}

}  // namespace
}  // namespace stillmap
