#pragma once

// Trajectories in the TUM format: `stamp tx ty tz qx qy qz qw`, metres, seconds, camera to world.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"
#include "kernels/base/se3.hpp"
#include "runtime/core/number_text.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

struct TimedPose {
  Stamp stamp;
  Se3d T_world_cam;
};

struct Trajectory {
  std::vector<TimedPose> poses;  ///< by stamp, each stamp once
  uint64_t repeated_stamps = 0;  ///< lines that gave way to a later line with the same stamp
};

/// The stamp as the nearest double: what a script sees that reads the text. (Stamp::seconds rounds twice.)
double exact_seconds(Stamp stamp);

/// Seconds with nine decimals, exactly.
std::string stamp_text(Stamp stamp);

/// Reads a trajectory. Columns are parted by spaces, tabs or commas; `#` starts a comment; quaternions of any
/// length above 0 are normalised; lines may come in any order.
/// @return an error naming file and line for a wrong number of columns, what is no finite number, a position
/// beyond
///         1e7 m, a quaternion of length 0, a line over 4096 bytes, a file over 1 GiB or without poses
Result<Trajectory> read_trajectory(const std::string& path);

/// "X,Y,Z,QX,QY,QZ,QW" as on the command line.
Result<Se3d> parse_pose(std::string_view text);

}  // namespace stillmap
