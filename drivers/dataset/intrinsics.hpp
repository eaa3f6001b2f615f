#pragma once

#include <optional>
#include <string>

#include "config/calibration.hpp"
#include "config/result.hpp"
#include "drivers/dataset/dataset_options.hpp"
#include "kernels/base/pinhole.hpp"

namespace stillmap {

/// The camera of a recording, still without the size of its images.
struct DatasetCamera {
  CameraModel model;
  float depth_units_per_m = 0;
  std::string origin;  ///< where the intrinsics are from, for messages
  DepthBias depth_bias = {};
  std::optional<DepthCamera> depth_camera = {};  ///< none: depth is registered
};

/// What a kind of recording falls back to.
struct CameraDefaults {
  std::optional<CameraModel> model;
  float depth_units_per_m = 5000;
};

/// The camera of the recordings that everybody knows, by the name of the folder: freiburg1, freiburg2,
/// freiburg3, bonn.
std::optional<CameraModel> camera_by_folder_name(const std::string& folder_name);

/// Intrinsics from, in this order: `options.camera`, DIR/camera.toml, DIR/camera-intrinsics.txt (3x3), the
/// name of the folder, `defaults`. Depth scale from: `options`, DIR/camera.toml, `defaults`.
/// @return an error of kind bad_usage that names the file when nothing is found or a number makes no sense
/// @thread boot
Result<DatasetCamera> find_camera(const std::string& dir, const DatasetOptions& options,
                                  const CameraDefaults& defaults);

}  // namespace stillmap
