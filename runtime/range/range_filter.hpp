#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "config/config.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Believes an echo when it lies where the last one can have moved to, or when the next one says the same
/// again: one alone that jumps is noise. What is believed goes through a median.        test:
/// range_filter_test
/// @thread one; neither waits nor allocates
class RangeFilter {
 public:
  static constexpr float kFastest_m_s =
      10;  ///< that anything comes nearer or goes, the robot's own way included
  static constexpr float kRounding_m = 0.05f;  ///< of two readings of one thing
  static constexpr int32_t kMostMedian = 15;

  explicit RangeFilter(const SonarConfig& sonar) : sonar_(sonar) {}

  /// @param range_m of an echo, within sonar.min_m and max_m  @param at later than that before it
  /// @return the median of the last sonar.median believed ones, of two in the middle the nearer one; none:
  /// this one is not believed
  std::optional<float> add(Stamp at, float range_m);

 private:
  struct Echo {
    Stamp at;
    float range_m = 0;
  };

  bool follows(const Echo& later, const Echo& earlier) const;
  void believe(const Echo& echo);
  float median() const;

  const SonarConfig sonar_;
  std::array<Echo, kMostMedian> believed_{};  ///< ring
  int32_t count_ = 0, next_ = 0;
  Echo last_;                    ///< the last one that was believed, where count_ > 0
  std::optional<Echo> doubted_;  ///< the last one, where it was not
};

}  // namespace stillmap
