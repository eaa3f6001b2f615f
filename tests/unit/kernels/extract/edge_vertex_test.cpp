#include "kernels/extract/edge_vertex.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

bool same(Rgb8 a, Rgb8 b) {
  return a.r == b.r && a.g == b.g && a.b == b.b;
}

TEST(Crossing, IsLinearAndKeptOffTheEnds) {
  EXPECT_FLOAT_EQ(crossing(100, -300), 0.25f);
  EXPECT_FLOAT_EQ(crossing(-300, 100), 0.75f);
  EXPECT_FLOAT_EQ(crossing(0, -300), 0.001f);
  EXPECT_FLOAT_EQ(crossing(-300, 0), 0.999f);
  EXPECT_FLOAT_EQ(crossing(kSdfMax, -kSdfMax), 0.5f);
}

TEST(ColourBetween, MixesTheTwoEnds) {
  const VoxelSurface dark{0, 0}, bright{0, static_cast<uint16_t>(kLumaScale)};
  const VoxelRecord seen{1, 1, 128, 128};
  EXPECT_TRUE(same(colour_between(dark, seen, bright, seen, 0.0f), {0, 0, 0}));
  EXPECT_TRUE(same(colour_between(dark, seen, bright, seen, 1.0f), {255, 255, 255}));
  EXPECT_TRUE(same(colour_between(dark, seen, bright, seen, 0.4f), {102, 102, 102}));
}

TEST(ColourBetween, TakesTheEndThatHasColour) {
  const VoxelSurface dark{0, 0}, bright{0, static_cast<uint16_t>(kLumaScale)};
  const VoxelRecord seen{1, 1, 128, 128}, unseen{1, 0, 128, 128};
  EXPECT_TRUE(same(colour_between(dark, unseen, bright, seen, 0.1f), {255, 255, 255}));
  EXPECT_TRUE(same(colour_between(dark, seen, bright, unseen, 0.9f), {0, 0, 0}));
  EXPECT_TRUE(same(colour_between(dark, unseen, bright, unseen, 0.5f), kUncoloured));
}

}  // namespace
}  // namespace stillmap
