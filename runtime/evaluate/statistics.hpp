#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace stillmap {

/// A figure that could not be measured: not a number.
inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Of a list of errors, in their unit. As the TUM benchmark's scripts compute them: `std` divides by n, the
/// median of an even number is the mean of the middle two.
struct Statistics {
  uint64_t count = 0;
  double rmse = 0, mean = 0, median = 0, std = 0, min = 0, max = 0;
};

/// @param values finite; empty gives all zeros.                          test: ate_test
Statistics statistics_of(std::vector<double> values);

}  // namespace stillmap
