#include "kernels/backend/cpu/thread_pool.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

namespace stillmap {
namespace {

TEST(ThreadPool, CallsEveryIndexOnceAndReturnsWhenAllAreDone) {
  for (const int32_t threads : {1, 2, 3, 8}) {
    ThreadPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    for (const uint32_t count : {0u, 1u, 2u, 7u, 1000u}) {
      std::vector<int> calls(count);  // plain: what workers wrote must be seen after the call
      pool.for_each(count, [&](uint32_t i) { ++calls[i]; });
      for (const int n : calls) EXPECT_EQ(n, 1);
    }
  }
}

TEST(ThreadPool, TheNumberOfThreadsIsKeptInRange) {
  EXPECT_EQ(ThreadPool(0).threads(), 1);
  EXPECT_EQ(ThreadPool(-4).threads(), 1);
  EXPECT_EQ(ThreadPool(100).threads(), 64);
}

TEST(ThreadPool, ManyShortJobsInARowDoNotMixUp) {
  ThreadPool pool(4);
  std::vector<uint32_t> values(64);
  for (uint32_t job = 1; job <= 2000; ++job) {
    pool.for_each(64, [&](uint32_t i) { values[i] += job * i; });
    if (job % 500 == 0) {
      for (uint32_t i = 0; i < 64; ++i) EXPECT_EQ(values[i], i * (job * (job + 1) / 2));
    }
  }
}

TEST(ThreadPool, EndsAtOnceWhetherItWorkedOrNot) {
  for (int n = 0; n < 50; ++n) {
    std::atomic<int> calls{0};
    {
      ThreadPool pool(3);
      if (n % 2) pool.for_each(5, [&](uint32_t) { ++calls; });
    }
    EXPECT_EQ(calls, n % 2 ? 5 : 0);
  }
}

}  // namespace
}  // namespace stillmap
