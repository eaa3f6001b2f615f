#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>

#include "runtime/ports/range_sensor.hpp"

namespace stillmap {

/// The last valid readings of the sonar: what it saw when a frame was taken.           test:
/// range_history_test
/// @thread one; neither waits nor allocates
class RangeHistory {
 public:
  static constexpr uint32_t kReadings = 64;  ///< of more than three seconds at 20 Hz; the oldest makes way

  /// @param max_age_s sonar.max_age_s
  explicit RangeHistory(double max_age_s) : max_age_ns_(static_cast<int64_t>(max_age_s * 1e9)) {}

  void add(const RangeReading& reading) {
    if (reading.valid) ring_[added_++ % kReadings] = reading;
  }

  /// The reading nearest in time to `captured` (CLOCK_MONOTONIC), earlier or later, within max_age_s.
  /// @return metres; 0: there is none
  float at(Stamp captured) const {
    float range_m = 0;
    int64_t best_ns = max_age_ns_;
    for (uint32_t age = 0; age < kReadings && age < added_; ++age) {
      const RangeReading& reading = ring_[(added_ - 1 - age) % kReadings];
      const int64_t away_ns = std::abs(reading.stamp.ns - captured.ns);
      if (away_ns > best_ns || (away_ns == best_ns && range_m > 0)) continue;
      best_ns = away_ns;
      range_m = reading.range_m;
    }
    return range_m;
  }

 private:
  const int64_t max_age_ns_;
  std::array<RangeReading, kReadings> ring_{};
  uint64_t added_ = 0;
};

}  // namespace stillmap
