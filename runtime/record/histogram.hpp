#pragma once

#include <array>
#include <cstdint>

namespace stillmap {

/// Durations over a run of any length in fixed memory: bins of 1 % width from 1 us to 100 s.
/// Mean and maximum are exact, percentiles right to 0.5 %. Does not allocate. @thread one
class DurationHistogram {
 public:
  void add(double ms);

  uint64_t count() const { return count_; }
  /// All in milliseconds; 0 when nothing was added.
  double mean() const;
  double max() const { return max_; }
  /// @param share 0..1; the smallest duration that this share of all does not exceed
  double percentile(double share) const;

 private:
  static constexpr double kSmallestMs = 1e-3;
  static constexpr double kBinRatio = 1.01;
  static constexpr uint32_t kBins = 1852;  ///< log(1e5 / kSmallestMs) / log(kBinRatio)

  std::array<uint64_t, kBins> bins_{};
  uint64_t count_ = 0;
  double sum_ = 0, min_ = 0, max_ = 0;
};

}  // namespace stillmap
