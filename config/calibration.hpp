#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/params.hpp"
#include "kernels/prepare/depth_bias.hpp"

namespace stillmap {

/// A depth camera whose images are its own, not registered to the colour image.
struct DepthCamera {
  CameraModel model;
  Se3d T_colour_depth;  ///< points of the depth camera into the colour camera, both optical; metres
};

// clang-format off
/// What is known of a pair of cameras. In a file (TOML):
///
///     depth_scale = 1000.0          # raw depth units in a metre
///     depth_bias = [0.0, 1.0]       # true = c0 + c1 m + c2 m^2 + c3 m^3, m what is measured, in metres; 1 to 4
///     [colour]                      # to which depth is registered; without the heading these keys stand alone
///     width = 640                   # pixels; may be left out
///     height = 480
///     fx = 525.0                    # pixels; the centre of the top-left pixel is (0, 0)
///     fy = 525.0
///     cx = 319.5
///     cy = 239.5
///     distortion = [0.0, 0.0, 0.0, 0.0, 0.0]      # k1 k2 p1 p2 k3, Brown-Conrady in OpenCV's order
///     [depth]                       # only for a source whose depth is not registered to colour; keys as [colour]
///     T_colour_depth = [-0.025, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]     # place in m, unit quaternion x y z w
///
/// All of it may be left out.
// clang-format on
struct Calibration {
  std::optional<CameraModel> colour;  ///< width and height 0 where the file does not say
  std::optional<DepthCamera> depth;   ///< none: it is registered to colour
  float depth_units_per_m = 0;        ///< 0: not said
  DepthBias depth_bias;
};

/// What else a file may hold.
enum class OtherKeys : uint8_t {
  refused,  ///< nothing
  let_be    ///< anything that is no key of ours misspelt: camera.toml beside a recording
};

/// Unknown keys, wrong types, numbers that are not finite or make no camera are errors, all of them listed,
/// one a line: file, line, key, what was expected.
/// @return an error of kind bad_usage
/// @thread boot
Result<Calibration> load_calibration(const std::string& path, OtherKeys others = OtherKeys::refused);
/// The same from text; `name` stands for the file in messages.
Result<Calibration> parse_calibration(const std::string& text, const std::string& name,
                                      OtherKeys others = OtherKeys::refused);

/// The file that camera.calibration stands for: itself, or, where it is a bare name ("xtion"), NAME.toml of
/// those that come with the program (config/calibrations beside config/presets).
/// @return an error of kind bad_usage that says where it was looked for
Result<std::string> find_calibration(const std::string& name);

/// What no camera of this kind is like, though it could be used: an angle of view outside of 20 to 120
/// degrees, a centre outside of the middle half, distortion that folds over inside the image, a baseline of
/// more than half a metre, a bias of more than a tenth. One line each: file, key, value, expected.
/// @param file for the messages  @param cols, rows of the images where the calibration does not say
/// @param depth its min_m and max_m are the working range
std::vector<std::string> implausible(const Calibration& calibration, const std::string& file, int32_t cols,
                                     int32_t rows, const DepthParams& depth);
/// Of one lens. @param before of each line: "FILE: colour."  @param camera with its size
std::vector<std::string> implausible(const CameraModel& camera, const std::string& before);

}  // namespace stillmap
