#include "runtime/record/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace stillmap {
namespace {

TEST(DurationHistogram, EmptyIsZero) {
  const DurationHistogram h;
  EXPECT_EQ(h.count(), 0u);
  EXPECT_EQ(h.mean(), 0);
  EXPECT_EQ(h.percentile(0.5), 0);
}

TEST(DurationHistogram, OneValueIsEveryPercentile) {
  DurationHistogram h;
  h.add(12.34);
  for (const double share : {0.0, 0.5, 0.95, 1.0}) EXPECT_DOUBLE_EQ(h.percentile(share), 12.34);
}

TEST(DurationHistogram, AgreesWithSortingToHalfAPercent) {
  std::mt19937 random(7);
  std::lognormal_distribution<double> times(3, 1);
  DurationHistogram h;
  std::vector<double> all;
  for (int i = 0; i < 20000; ++i) {
    all.push_back(times(random));
    h.add(all.back());
  }
  std::sort(all.begin(), all.end());
  double sum = 0;
  for (const double ms : all) sum += ms;
  EXPECT_NEAR(h.mean(), sum / 20000, 1e-6);
  EXPECT_EQ(h.max(), all.back());
  for (const double share : {0.01, 0.5, 0.95, 0.99}) {
    const double truth = all[static_cast<size_t>(std::ceil(share * 20000)) - 1];
    EXPECT_NEAR(h.percentile(share), truth, 0.0051 * truth) << share;
  }
}

TEST(DurationHistogram, TakesExtremesAndIgnoresNonsense) {
  DurationHistogram h;
  h.add(0);
  h.add(1e9);
  h.add(-1);
  h.add(std::numeric_limits<double>::quiet_NaN());
  h.add(std::numeric_limits<double>::infinity());
  EXPECT_EQ(h.count(), 2u);
  EXPECT_EQ(h.max(), 1e9);
  EXPECT_LE(h.percentile(0.5), 0.0011);
}

}  // namespace
}  // namespace stillmap
