#pragma once

#include <cstdint>
#include <optional>

#include "kernels/base/pinhole.hpp"

namespace stillmap {

/// What is asked of a camera, or of a recording that is played by the library of one.
struct CameraOptions {
  int32_t cols = 640, rows = 480;  ///< of depth and colour
  float rate_hz = 30;
  bool auto_exposure = true, auto_white_balance = true;
  double max_pair_ms = 20;            ///< largest distance of the stamps of a pair, >= 0
  double time_offset_ms = 0;          ///< added to the colour stamp before pairing
  double gone_s = 5;                  ///< waited for so long without a pair: the camera is gone, > 0
  std::optional<CameraModel> camera;  ///< wins over what the device says; width and height are not looked at
  float depth_units_per_m = 0;        ///< wins over what the device says; 0: not given
};

}  // namespace stillmap
