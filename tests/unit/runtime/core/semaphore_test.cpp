#include "runtime/core/semaphore.hpp"

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <atomic>
#include <thread>

namespace stillmap {
namespace {

using std::chrono::milliseconds;

TEST(Semaphore, CountsReleases) {
  Semaphore semaphore;
  EXPECT_FALSE(semaphore.try_acquire());
  semaphore.release();
  semaphore.release();
  EXPECT_TRUE(semaphore.try_acquire());
  EXPECT_TRUE(semaphore.try_acquire_for(milliseconds(0)));
  EXPECT_FALSE(semaphore.try_acquire());
}

TEST(Semaphore, GivesUpWhenTheTimeIsOver) {
  Semaphore semaphore;
  const int64_t start_ns = monotonic_ns();
  EXPECT_FALSE(semaphore.try_acquire_for(milliseconds(20)));
  EXPECT_GE(monotonic_ns() - start_ns, 20'000'000);
  EXPECT_FALSE(semaphore.try_acquire_for(milliseconds(-5)));
}

/// Who looks now and then is late.
TEST(Semaphore, AWaitSleepsOnce) {
  Semaphore semaphore;
  rusage before{}, after{};
  getrusage(RUSAGE_THREAD, &before);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(semaphore.try_acquire_for(milliseconds(40)));
  getrusage(RUSAGE_THREAD, &after);
  EXPECT_LE(after.ru_nvcsw - before.ru_nvcsw, 10 + 2) << "woken without a reason";
}

TEST(Semaphore, WakesWhoWaits) {
  Semaphore semaphore;
  std::atomic<int> woken{0};
  std::jthread waiter([&] {
    while (woken < 100 && semaphore.try_acquire_for(milliseconds(10000))) ++woken;
  });
  for (int i = 0; i < 100; ++i) semaphore.release();
  waiter.join();
  EXPECT_EQ(woken, 100);
}

}  // namespace
}  // namespace stillmap
