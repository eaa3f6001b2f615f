#pragma once

#include <cstdint>
#include <vector>

#include "config/calibration.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

/// Raw depth of one camera as another camera would see it: every depth pixel covers the pixels of the colour
/// image that its footprint falls on; of several, the nearest stays. What is hidden from the depth camera is
/// invalid.                                                                     test: depth_registration_test
/// @thread make: boot; run: one, without allocating
class DepthRegistration {
 public:
  /// @param depth with the size of its images  @param colour with its size; with its distortion, for what
  /// comes out lies in the image as it is, and is undistorted with it  @param units_per_m raw units, > 0
  DepthRegistration(const DepthCamera& depth, const CameraModel& colour, float units_per_m);

  /// @param depth_raw of the depth camera; 0 and 65535 are invalid  @param registered_raw of the size of the
  /// colour image; 0: invalid
  void run(ImageView<const uint16_t> depth_raw, ImageView<uint16_t> registered_raw) const;

  int32_t depth_rows() const { return depth_k_.height; }
  int32_t depth_cols() const { return depth_k_.width; }
  /// Of an object.
  static uint64_t bytes(int32_t depth_rows, int32_t depth_cols) {
    return static_cast<uint64_t>(depth_rows) * static_cast<uint64_t>(depth_cols) * sizeof(Vec3);
  }

 private:
  /// Half of what a depth pixel covers, in pixels of the colour image, where both cameras are as far away.
  struct Footprint {
    float half_cols = 0, half_rows = 0;
  };

  const Intrinsics depth_k_;
  const CameraModel colour_;
  const float units_per_m_;
  const Vec3 t_colour_depth_m_;
  Footprint footprint_;
  std::vector<Vec3> ray_;  ///< of each depth pixel at a depth of 1, turned into the colour camera's axes
};

}  // namespace stillmap
