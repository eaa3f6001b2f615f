#pragma once

#include <cstdint>
#include <vector>

#include "config/calibration.hpp"
#include "kernels/prepare/register_pixel.hpp"

namespace stillmap {

struct CpuLoops;

/// Raw depth of one camera as another camera would see it: every depth pixel covers the pixels of the colour
/// image that its footprint falls on; of several, the nearest stays. What is hidden from the depth camera is
/// invalid.                                                                     test: depth_registration_test
/// @thread make: boot; run: one, without allocating
class DepthRegistration {
 public:
  /// @param depth with the size of its images  @param colour with its size; with its distortion, for what
  /// comes out lies in the image as it is, and is undistorted with it  @param units_per_m raw units, > 0
  /// @param loops nullptr: the best for this machine
  DepthRegistration(const DepthCamera& depth, const CameraModel& colour, float units_per_m,
                    const CpuLoops* loops = nullptr);

  /// @param depth_raw of the depth camera; 0 and 65535 are invalid  @param registered_raw of the size of the
  /// colour image; 0: invalid
  void run(ImageView<const uint16_t> depth_raw, ImageView<uint16_t> registered_raw) const;

  DepthRegistration(const DepthRegistration&) = delete;  // pass_ looks at the rays
  DepthRegistration& operator=(const DepthRegistration&) = delete;

  int32_t depth_rows() const { return depth_k_.height; }
  int32_t depth_cols() const { return depth_k_.width; }
  /// Of an object.
  static uint64_t bytes(int32_t depth_rows, int32_t depth_cols) {
    return static_cast<uint64_t>(depth_rows) * static_cast<uint64_t>(depth_cols) * 3 * sizeof(float);
  }

 private:
  const Intrinsics depth_k_;
  std::vector<float> ray_x_, ray_y_, ray_z_;
  RegisterPass pass_;
  const CpuLoops& loops_;
};

}  // namespace stillmap
