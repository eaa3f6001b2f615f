#pragma once

#include <atomic>
#include <cstdint>

namespace stillmap {

/// CLOCK_MONOTONIC, nanoseconds.  @thread any
int64_t monotonic_ns();
/// CLOCK_REALTIME, nanoseconds since 1970.  @thread any
int64_t wall_ns();

/// Monotonic time as UTC. The offset is measured when it is made and followed slowly, so that stamps neither
/// jump nor run backwards while the wall clock is disciplined; when the wall clock is set (a step), the
/// offset follows at once and the step is counted.
/// @thread to_utc_us: any; follow: one
class UtcClock {
 public:
  static constexpr int64_t kStepNs = 100'000'000;  ///< a larger difference is a step
  static constexpr double kSlew = 500e-6;          ///< seconds a second, at most

  UtcClock();

  int64_t to_utc_us(int64_t monotonic_ns) const {
    return (monotonic_ns + offset_ns_.load(std::memory_order_relaxed)) / 1000;
  }
  int64_t to_monotonic_ns(int64_t utc_us) const {
    return utc_us * 1000 - offset_ns_.load(std::memory_order_relaxed);
  }
  /// Now and then, some times a second at most.
  /// @return true: the wall clock stepped
  bool follow() { return follow(monotonic_ns(), wall_ns()); }
  bool follow(int64_t now_monotonic_ns, int64_t now_wall_ns);

 private:
  std::atomic<int64_t> offset_ns_;
  int64_t followed_ns_;
};

}  // namespace stillmap
