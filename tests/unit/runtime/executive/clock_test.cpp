#include "runtime/core/clock.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

namespace stillmap {
namespace {

constexpr int64_t kSecond_ns = 1'000'000'000;

TEST(UtcClock, BeginsWithTheWallClock) {
  const UtcClock clock;
  EXPECT_LT(std::abs(clock.to_utc_us(monotonic_ns()) - wall_ns() / 1000), 20'000);
}

TEST(UtcClock, TheWayBackLeadsToTheSameTime) {
  const UtcClock clock;
  const int64_t now_ns = monotonic_ns();
  EXPECT_LT(std::abs(clock.to_monotonic_ns(clock.to_utc_us(now_ns)) - now_ns), 1000);
}

TEST(UtcClock, ASmallDifferenceIsFollowedSlowly) {
  UtcClock clock;
  const int64_t start_ns = monotonic_ns(), before_us = clock.to_utc_us(start_ns);
  const int64_t wall_start_ns = before_us * 1000;
  // The wall clock is 50 ms ahead from now on.
  constexpr int64_t kAhead_ns = 50'000'000;
  for (int i = 1; i <= 10; ++i)
    EXPECT_FALSE(clock.follow(start_ns + i * kSecond_ns, wall_start_ns + i * kSecond_ns + kAhead_ns));
  const int64_t gained_us = clock.to_utc_us(start_ns) - before_us;
  EXPECT_GT(gained_us, 4000);  // 0.5 ms a second
  EXPECT_LT(gained_us, 6000);
}

TEST(UtcClock, AStepIsSaidAndFollowedAtOnce) {
  UtcClock clock;
  const int64_t start_ns = monotonic_ns(), before_us = clock.to_utc_us(start_ns);
  EXPECT_TRUE(clock.follow(start_ns + kSecond_ns, before_us * 1000 + 3601 * kSecond_ns));
  EXPECT_NEAR(static_cast<double>(clock.to_utc_us(start_ns) - before_us), 3600e6, 1e4);
  EXPECT_FALSE(clock.follow(start_ns + 2 * kSecond_ns, before_us * 1000 + 3602 * kSecond_ns));
}

}  // namespace
}  // namespace stillmap
