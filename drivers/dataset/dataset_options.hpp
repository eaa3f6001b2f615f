#pragma once

#include <optional>
#include <string>

#include "kernels/base/pinhole.hpp"

namespace stillmap {

/// What the person who opens a recording knows better than its folder.
struct DatasetOptions {
  std::optional<CameraModel> camera;       ///< wins over every file; width and height are not looked at
  std::string camera_origin = "--camera";  ///< where it is from, for messages
  float depth_units_per_m = 0;             ///< wins over every file; 0: not given
  std::string calibration;    ///< camera.calibration: wins over what the folder says; empty: none
  double time_offset_ms = 0;  ///< added to the colour stamps before pairing
  double max_pair_ms = 20;    ///< largest distance of the stamps of a pair, >= 0
};

}  // namespace stillmap
