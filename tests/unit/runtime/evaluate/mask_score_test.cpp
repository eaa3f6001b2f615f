#include "runtime/evaluate/mask_score.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr int32_t kRows = 20, kCols = 40;

/// Truth: dynamic right of column 20. Depth: 2 m everywhere.
struct Images {
  std::vector<uint8_t> truth, mask;
  std::vector<float> depth_m;

  Images() : truth(kRows * kCols), mask(kRows * kCols), depth_m(kRows * kCols, 2.0f) {
    for (int32_t i = 0; i < kRows * kCols; ++i) truth[static_cast<size_t>(i)] = i % kCols >= 20 ? 255 : 0;
  }
  void mask_from(int32_t column) {
    for (int32_t i = 0; i < kRows * kCols; ++i) mask[static_cast<size_t>(i)] = i % kCols >= column ? 255 : 0;
  }
  MaskCounts counts() const {
    return MaskComparison(kRows, kCols)
        .compare({truth.data(), kRows, kCols, kCols}, {mask.data(), kRows, kCols, kCols},
                 {depth_m.data(), kRows, kCols, kCols});
  }
};

TEST(MaskComparison, ADifferenceInsideTheBorderDoesNotCount) {
  Images images;
  images.mask_from(18);  // two columns too many; columns 17 to 22 are the border
  const MaskCounts n = images.counts();
  EXPECT_EQ(n.pixels, kRows * kCols);
  EXPECT_EQ(n.truly_dynamic, kRows * 20);
  EXPECT_EQ(n.valid_static, kRows * 20);
  EXPECT_EQ(n.judged_both, kRows * 17);
  EXPECT_EQ(n.judged_either, kRows * 17);
  EXPECT_EQ(n.judged_static, kRows * 17);
  EXPECT_EQ(n.judged_false, 0);
}

TEST(MaskComparison, WhatIsMissedAndWhatIsTooMuchCountsOutsideTheBorder) {
  Images images;
  images.mask_from(10);
  MaskCounts n = images.counts();
  EXPECT_EQ(n.judged_false, kRows * 7);
  EXPECT_EQ(n.judged_either, kRows * 24);
  EXPECT_EQ(n.judged_both, kRows * 17);
  images.mask_from(30);
  n = images.counts();
  EXPECT_EQ(n.judged_both, kRows * 10);
  EXPECT_EQ(n.judged_either, kRows * 17);
}

TEST(MaskComparison, OnlyValidDepthCounts) {
  Images images;
  images.mask_from(20);
  for (int32_t i = 0; i < 10 * kCols; ++i) images.depth_m[static_cast<size_t>(i)] = i % 2 ? 0.0f : 5.5f;
  const MaskCounts n = images.counts();
  EXPECT_EQ(n.valid, 10 * kCols);
  EXPECT_EQ(n.judged_both, 10 * 17);
  EXPECT_DOUBLE_EQ(n.static_share_of_valid(), 0.5);
  EXPECT_DOUBLE_EQ(n.static_share_of_view(), 0.25);
}

TEST(MaskComparison, WhatWasJustPutDownIsCountedApart) {
  Images images;
  for (int32_t i = 0; i < kRows * kCols; ++i)
    if (i % kCols < 4) images.truth[static_cast<size_t>(i)] = kPutDown;
  images.mask_from(2);
  const MaskCounts n = images.counts();
  EXPECT_EQ(n.put_down, kRows * 4);
  EXPECT_EQ(n.put_down_masked, kRows * 2);
  EXPECT_EQ(n.valid_static, kRows * 20);  // it stands still
  EXPECT_EQ(n.judged_static, kRows * 13);
  EXPECT_EQ(n.judged_false, kRows * 13);
  EXPECT_EQ(n.judged_either, kRows * 30);
}

Stamp at(double s) {
  return {static_cast<int64_t>(s * 1e9)};
}

MaskCounts frame(int64_t dynamic, int64_t both, int64_t either) {
  MaskCounts n;
  n.pixels = 1000;
  n.truly_dynamic = dynamic;
  n.judged_both = both;
  n.judged_either = either;
  return n;
}

TEST(MaskScore, AMoverCountsOneSecondAfterItCameIn) {
  MaskScore score;
  score.add(at(5.0), frame(100, 0, 10));
  score.add(at(5.9), frame(100, 0, 10));  // neither run nor mover is a second old
  EXPECT_TRUE(std::isnan(score.iou()));
  score.add(at(6.0), frame(100, 5, 10));
  EXPECT_DOUBLE_EQ(score.iou(), 0.5);
  score.add(at(6.1), frame(20, 0, 10));   // 2 % and not over it: gone
  score.add(at(6.2), frame(100, 0, 10));  // back: a new second
  score.add(at(7.1), frame(100, 0, 10));
  EXPECT_EQ(score.iou_frames(), 1u);
  score.add(at(7.3), frame(100, 10, 10));
  EXPECT_DOUBLE_EQ(score.iou(), 0.75);
}

TEST(MaskScore, StaticPixelsMaskedAreAMeanOverAllFrames) {
  MaskScore score;
  MaskCounts n = frame(0, 0, 0);
  n.judged_static = 100;
  score.add(at(0), n);
  n.judged_false = 10;
  score.add(at(1), n);
  EXPECT_DOUBLE_EQ(score.static_masked(), 0.05);
}

}  // namespace
}  // namespace stillmap
