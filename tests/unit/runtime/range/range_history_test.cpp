#include "runtime/range/range_history.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr int64_t kMillisecond = 1'000'000;

RangeReading reading(int64_t at_ms, float range_m, bool valid = true) {
  return {{at_ms * kMillisecond}, range_m, valid, false};
}

TEST(RangeHistory, KnowsNothingAtFirst) {
  EXPECT_EQ(RangeHistory(0.25).at({1000 * kMillisecond}), 0.0f);
}

TEST(RangeHistory, TheNearestInTimeSpeaksForAFrame) {
  RangeHistory history(0.25);
  history.add(reading(1000, 0.5f));
  history.add(reading(1066, 0.4f));
  history.add(reading(1132, 0.3f));
  EXPECT_EQ(history.at({1010 * kMillisecond}), 0.5f);
  EXPECT_EQ(history.at({1040 * kMillisecond}), 0.4f);
  EXPECT_EQ(history.at({1100 * kMillisecond}), 0.3f);
  EXPECT_EQ(history.at({1132 * kMillisecond}), 0.3f);
}

TEST(RangeHistory, NoneSpeaksForAFrameThatIsFarAway) {
  RangeHistory history(0.25);
  history.add(reading(1000, 0.5f));
  EXPECT_EQ(history.at({1250 * kMillisecond}), 0.5f);
  EXPECT_EQ(history.at({1251 * kMillisecond}), 0.0f);
  EXPECT_EQ(history.at({750 * kMillisecond}), 0.5f);
  EXPECT_EQ(history.at({749 * kMillisecond}), 0.0f);
}

TEST(RangeHistory, WhatIsNotValidIsNotKept) {
  RangeHistory history(0.25);
  history.add(reading(1000, 0.5f));
  history.add(reading(1066, 0.1f, false));
  EXPECT_EQ(history.at({1066 * kMillisecond}), 0.5f);
}

TEST(RangeHistory, TheOldestMakesWay) {
  RangeHistory history(0.01);
  constexpr int kAll = 3 * RangeHistory::kReadings;
  for (int i = 0; i < kAll; ++i) history.add(reading(1000 + 50 * i, 0.01f * static_cast<float>(i + 1)));
  const int oldest = kAll - RangeHistory::kReadings;
  EXPECT_EQ(history.at({(1000 + 50 * (oldest - 1)) * kMillisecond}), 0.0f);
  for (int i = oldest; i < kAll; ++i)
    EXPECT_EQ(history.at({(1000 + 50 * i) * kMillisecond}), 0.01f * static_cast<float>(i + 1));
}

}  // namespace
}  // namespace stillmap
