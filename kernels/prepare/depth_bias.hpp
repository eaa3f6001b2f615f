#pragma once

#include "kernels/base/hd.hpp"

namespace stillmap {

/// What a depth camera measures wrongly, the same in every pixel:
///   true = c[0] + c[1] m + c[2] m^2 + c[3] m^3, both in metres.
/// Beyond `last_m` the difference stays what it is there: a polynomial says nothing about what it was not
/// fitted to.                                                                      test: prepare_test
struct DepthBias {
  float c[4] = {0, 1, 0, 0};

  STILLMAP_HD bool none() const { return c[0] == 0 && c[1] == 1 && c[2] == 0 && c[3] == 0; }

  /// @param measured_m, last_m metres, >= 0
  STILLMAP_HD float corrected(float measured_m, float last_m) const {
    const float m = measured_m < last_m ? measured_m : last_m;
    return c[0] + m * (c[1] + m * (c[2] + m * c[3])) + (measured_m - m);
  }
};

}  // namespace stillmap
