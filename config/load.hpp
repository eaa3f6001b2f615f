#pragma once

#include <array>
#include <optional>
#include <string>

#include "config/config.hpp"
#include "config/result.hpp"

namespace stillmap {

/// Reads a TOML file over the defaults. Unknown sections and keys, wrong types, names that a switch does not
/// have and numbers that are not finite are errors, all of them listed, one a line: file, line, key, what was
/// expected. Ranges are not looked at here: see `violations`.
/// @return an error of kind bad_usage
/// @thread boot
Result<Config> load_config(const std::string& path);

/// The same from text; `name` stands for the file in messages.
Result<Config> parse_config(const std::string& text, const std::string& name);

/// Sets one value from the command line.
/// @param setting "section.key=value"; names of a switch with or without quotes
Result<Done> apply_setting(Config& config, const std::string& setting);

/// What `camera.toml` beside a recording may say.
struct CameraFile {
  std::optional<std::array<double, 4>> fx_fy_cx_cy;  ///< pixels; all four or none
  std::array<double, 5> distortion = {};             ///< k1 k2 p1 p2 k3, Brown-Conrady
  double depth_scale = 0;                            ///< raw depth units in a metre; 0: not said
};

/// Keys fx, fy, cx, cy, distortion = [k1, k2, p1, p2, k3], depth_scale. Other keys are let be, unless they
/// look like one of these misspelt. Whether the numbers make sense is the caller's to check.
Result<CameraFile> load_camera_file(const std::string& path);

}  // namespace stillmap
