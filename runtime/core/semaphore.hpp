#pragma once

#include <semaphore.h>

#include <cerrno>
#include <chrono>
#include <ctime>

#include "runtime/core/clock.hpp"

namespace stillmap {

/// The system's counting semaphore. A wait with a limit sleeps until it is woken. That of libstdc++ 12 sleeps
/// and looks, each time for half as long as it has waited: it is milliseconds late.    test: semaphore_test
/// @thread any; release neither waits nor allocates
class Semaphore {
 public:
  Semaphore() { sem_init(&semaphore_, 0, 0); }
  ~Semaphore() { sem_destroy(&semaphore_); }
  Semaphore(const Semaphore&) = delete;
  Semaphore& operator=(const Semaphore&) = delete;

  void release() { sem_post(&semaphore_); }
  bool try_acquire() { return sem_trywait(&semaphore_) == 0; }
  /// @return false: nobody released it within the time
  bool try_acquire_for(std::chrono::nanoseconds time) {
    constexpr int64_t kSecond_ns = 1'000'000'000;
    const int64_t until_ns = monotonic_ns() + time.count();
    const timespec until{static_cast<time_t>(until_ns / kSecond_ns),
                         static_cast<long>(until_ns % kSecond_ns)};
    int result = -1;
    do result = sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &until);
    while (result != 0 && errno == EINTR);
    return result == 0;
  }

 private:
  sem_t semaphore_;
};

}  // namespace stillmap
