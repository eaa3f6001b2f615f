#include "runtime/range/range_filter.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace stillmap {
namespace {

constexpr float kNone = -1;
constexpr int64_t kPeriod_ns = 66'000'000;

SonarConfig with_median(int32_t median) {
  SonarConfig sonar;
  sonar.median = median;
  return sonar;
}

/// What comes out for readings that come in one period after the other; kNone: not believed.
std::vector<float> filtered(const SonarConfig& sonar, const std::vector<float>& ranges_m) {
  RangeFilter filter(sonar);
  std::vector<float> out;
  int64_t now_ns = 5'000'000'000;
  for (const float range_m : ranges_m)
    out.push_back(filter.add({now_ns += kPeriod_ns}, range_m).value_or(kNone));
  return out;
}

TEST(RangeFilter, IsAMedianOfTheLast) {
  EXPECT_EQ(filtered(with_median(3), {1.0f, 1.2f, 1.1f, 1.4f, 1.05f}),
            (std::vector<float>{1.0f, 1.0f, 1.1f, 1.2f, 1.1f}));
  EXPECT_EQ(filtered(with_median(1), {1.0f, 1.2f, 1.1f}), (std::vector<float>{1.0f, 1.2f, 1.1f}));
}

TEST(RangeFilter, OfTwoInTheMiddleTheNearerCounts) {
  EXPECT_EQ(filtered(with_median(4), {1.0f, 1.3f, 1.1f, 1.2f}), (std::vector<float>{1.0f, 1.0f, 1.1f, 1.1f}));
}

TEST(RangeFilter, OneThatJumpsIsNotBelievedAndLeavesNoTrace) {
  EXPECT_EQ(filtered(with_median(3), {2.0f, 2.0f, 0.3f, 2.0f, 2.1f}),
            (std::vector<float>{2.0f, 2.0f, kNone, 2.0f, 2.0f}));
}

TEST(RangeFilter, TwoThatSayTheSameAreBelievedAndBeginAnew) {
  EXPECT_EQ(filtered(with_median(5), {2.0f, 2.0f, 2.0f, 0.3f, 0.32f, 0.31f}),
            (std::vector<float>{2.0f, 2.0f, 2.0f, kNone, 0.3f, 0.31f}));
}

TEST(RangeFilter, TwoThatJumpToDifferentPlacesAreNoise) {
  EXPECT_EQ(filtered(with_median(1), {3.9f, 0.3f, 2.0f, 0.9f, 3.9f}),
            (std::vector<float>{3.9f, kNone, kNone, kNone, 3.9f}));
}

// What is nearer than it can have come in the time is refused, what is at the limit is not.
TEST(RangeFilter, BelievesWhatCanHaveComeSoFar) {
  const float reach_m =
      RangeFilter::kFastest_m_s * static_cast<float>(kPeriod_ns) * 1e-9f + RangeFilter::kRounding_m;
  EXPECT_EQ(filtered(with_median(1), {2.0f, 2.0f - 0.99f * reach_m})[1], 2.0f - 0.99f * reach_m);
  EXPECT_EQ(filtered(with_median(1), {2.0f, 2.0f - 1.01f * reach_m})[1], kNone);
}

TEST(RangeFilter, AfterAPauseTheNextIsTakenAsItComes) {
  RangeFilter filter(with_median(3));
  EXPECT_EQ(filter.add({1'000'000'000}, 2.0f), 2.0f);
  EXPECT_EQ(filter.add({1'251'000'000}, 0.3f), 0.3f) << "sonar.max_age_s is 0.25";
}

}  // namespace
}  // namespace stillmap
