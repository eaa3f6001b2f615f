#pragma once

// Wheel odometry or the like, as the runtime sees it; drivers implement it.

#include "kernels/base/se3.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Where the body (x forward, y left, z up) was.
struct OdometrySample {
  Stamp stamp;
  Se3d T_odom_body;  ///< in any frame that does not jump; metres
};

/// @thread real-time thread; neither allocates nor waits
class OdometryPort {
 public:
  virtual ~OdometryPort() = default;

  /// The pose at `stamp` (clock of the odometry), between two samples where there is a later one, else the
  /// newest sample with its own, earlier stamp: how old is too old is for the caller to say.
  /// @return ok; timeout: no sample reaches back to `stamp`, or there is none
  virtual Status at(Stamp stamp, OdometrySample& sample) = 0;
  /// What came in its place and is none, since the start.  @thread any
  virtual uint32_t refused() const { return 0; }
};

}  // namespace stillmap
