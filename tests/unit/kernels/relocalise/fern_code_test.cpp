#include "kernels/relocalise/fern_code.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace stillmap {
namespace {

constexpr uint32_t kFerns = 512;
constexpr int32_t kRows = 30, kCols = 40;

/// A view as two functions of the cell, and its code.
struct CodedView {
  std::vector<float> depth_m, luma;
  std::vector<uint8_t> code = std::vector<uint8_t>(kFerns);

  template <class Depth, class Luma>
  CodedView(const Depth& depth_at, const Luma& luma_at) {
    float sum = 0;
    int32_t cells = 0;
    for (int32_t r = 0; r < kRows; ++r)
      for (int32_t c = 0; c < kCols; ++c) {
        depth_m.push_back(depth_at(r, c));
        luma.push_back(luma_at(r, c));
        if (luma.back() != kNoLuma) sum += luma.back(), ++cells;
      }
    const FernPass pass{{{depth_m.data(), kRows, kCols, kCols}, {luma.data(), kRows, kCols, kCols}},
                        cells > 0 ? sum / static_cast<float>(cells) : 0.0f,
                        {code.data(), kFerns}};
    for (uint32_t f = 0; f < kFerns; ++f) pass(f);
  }
  View<const uint8_t> view() const { return {code.data(), kFerns}; }
};

float slope(int32_t r, int32_t c) {
  return 1.0f + 0.05f * static_cast<float>(c) + 0.03f * static_cast<float>(r);
}
float grey(int32_t r, int32_t c) {
  return 0.2f + 0.01f * static_cast<float>((7 * r + 3 * c) % 40);
}

TEST(FernCode, FernsAreSpreadOverTheViewAndAlwaysTheSame) {
  int32_t left = 0, upper = 0;
  for (uint32_t f = 0; f < kFerns; ++f) {
    const Fern fern = fern_of(f, kRows, kCols), again = fern_of(f, kRows, kCols);
    ASSERT_TRUE(fern.row >= 0 && fern.row < kRows && fern.col >= 0 && fern.col < kCols);
    ASSERT_EQ(fern.depth_m[1], again.depth_m[1]);
    for (const float threshold_m : fern.depth_m)
      ASSERT_TRUE(threshold_m >= kFernNearest_m && threshold_m <= kFernFarthest_m);
    left += fern.col < kCols / 2;
    upper += fern.row < kRows / 2;
  }
  EXPECT_NEAR(left, kFerns / 2, 60);
  EXPECT_NEAR(upper, kFerns / 2, 60);
}

TEST(FernCode, TheSameViewIsEqualWhateverTheExposure) {
  const CodedView a(slope, grey), b(slope, [](int32_t r, int32_t c) { return 1.5f * grey(r, c); });
  EXPECT_EQ(code_similarity(a.view(), a.view()), 1.0f);
  EXPECT_GT(code_similarity(a.view(), b.view()), 0.99f);
}

TEST(FernCode, AnotherViewIsLessSimilarTheMoreItDiffers) {
  const CodedView a(slope, grey);
  const CodedView nearer([](int32_t r, int32_t c) { return slope(r, c) - 0.15f; }, grey);
  const CodedView other([](int32_t r, int32_t c) { return 4.4f - slope(r, c); },
                        [](int32_t r, int32_t c) { return grey(c, r); });
  const float near_by = code_similarity(a.view(), nearer.view()),
              far = code_similarity(a.view(), other.view());
  EXPECT_GT(near_by, 0.8f);
  EXPECT_LT(near_by, 1.0f);
  EXPECT_LT(far, 0.5f);
}

TEST(FernCode, MaskedCellsHaveNoSay) {
  const CodedView a(slope, grey);
  const auto hidden = [](int32_t c) { return c > 15 && c < 30; };
  const CodedView half([&](int32_t r, int32_t c) { return hidden(c) ? 0.0f : slope(r, c); },
                       [&](int32_t r, int32_t c) { return hidden(c) ? kNoLuma : grey(r, c); });
  EXPECT_GT(code_similarity(a.view(), half.view()), 0.9f);
  EXPECT_GT(std::count(half.code.begin(), half.code.end(), kNoVote), 100);
}

TEST(FernCode, TooFewVotesAreNoSimilarity) {
  const CodedView a(slope, grey);
  const CodedView nothing([](int32_t, int32_t) { return 0.0f; }, [](int32_t, int32_t) { return kNoLuma; });
  const CodedView strip([](int32_t r, int32_t c) { return c < 4 ? slope(r, c) : 0.0f; }, grey);
  EXPECT_EQ(code_similarity(a.view(), nothing.view()), 0.0f);
  EXPECT_EQ(code_similarity(a.view(), strip.view()), 0.0f);
}

}  // namespace
}  // namespace stillmap
