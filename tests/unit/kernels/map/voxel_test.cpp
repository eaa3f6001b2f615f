#include "kernels/map/voxel.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

namespace stillmap {
namespace {

TEST(Voxel, LuminanceHasTheWeightsOfThePaper) {
  EXPECT_FLOAT_EQ(luminance(Rgb8{255, 255, 255}), 1.0f);
  EXPECT_FLOAT_EQ(luminance(Rgb8{255, 0, 0}), 0.2126f);
  EXPECT_FLOAT_EQ(luminance(Rgb8{0, 255, 0}), 0.7152f);
  EXPECT_FLOAT_EQ(luminance(Rgb8{0, 0, 255}), 0.0722f);
  EXPECT_EQ(luma_chroma({255, 255, 255}).luma, 65280);
  EXPECT_EQ(luma_chroma({0, 0, 0}).luma, 0);
}

TEST(Voxel, GreysHaveNoChroma) {
  for (int g = 0; g < 256; ++g) {
    const auto v = static_cast<uint8_t>(g);
    const LumaChroma c = luma_chroma({v, v, v});
    EXPECT_EQ(c.cb, 128);
    EXPECT_EQ(c.cr, 128);
    EXPECT_EQ(colour_from(static_cast<float>(c.luma) / kLumaScale, 128, 128).g, v);
  }
}

// Chroma has a byte: a step of it is 1.6 to 1.9 grey levels in red and blue.
TEST(Voxel, ColoursComeBackWithinTwoGreyLevels) {
  for (int r = 0; r < 256; r += 15)
    for (int g = 0; g < 256; g += 15)
      for (int b = 0; b < 256; b += 15) {
        const Rgb8 in = {static_cast<uint8_t>(r), static_cast<uint8_t>(g), static_cast<uint8_t>(b)};
        const LumaChroma c = luma_chroma(in);
        const Rgb8 out = colour_from(static_cast<float>(c.luma) / kLumaScale, c.cb, c.cr);
        EXPECT_LE(std::abs(out.r - r), 2);
        EXPECT_LE(std::abs(out.g - g), 2);
        EXPECT_LE(std::abs(out.b - b), 2);
      }
}

TEST(Voxel, IndexCountsXFastest) {
  int32_t expected = 0;
  for (int32_t z = 0; z < 8; ++z)
    for (int32_t y = 0; y < 8; ++y)
      for (int32_t x = 0; x < 8; ++x) EXPECT_EQ(voxel_index(x, y, z), expected++);
}

}  // namespace
}  // namespace stillmap
