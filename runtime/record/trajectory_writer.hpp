#pragma once

#include <string>

#include "kernels/base/se3.hpp"
#include "runtime/ports/frame_source.hpp"
#include "runtime/record/output_file.hpp"

namespace stillmap {

/// One line of the TUM format, `stamp tx ty tz qx qy qz qw` with its line end; metres, camera to map.
/// The stamp has six digits and is not rounded through a double.
std::string tum_line(Stamp stamp, const Se3d& T_map_cam);

/// `seconds.micros` of a stamp, as in all files and file names.
std::string file_stamp(Stamp stamp);

/// Streams a trajectory. @thread one
class TrajectoryWriter {
 public:
  static Result<TrajectoryWriter> create(const std::string& path);

  bool write(Stamp stamp, const Se3d& T_map_cam);
  OutputFile& file() { return file_; }

 private:
  explicit TrajectoryWriter(OutputFile file);

  OutputFile file_;
};

}  // namespace stillmap
