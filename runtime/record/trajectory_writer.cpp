#include "runtime/record/trajectory_writer.hpp"

#include <fmt/format.h>

#include <utility>

namespace stillmap {

std::string file_stamp(Stamp stamp) {
  constexpr int64_t kNsPerUs = 1000, kUsPerS = 1000000;
  // Rounded to the nearest microsecond, also below zero.
  const int64_t half = stamp.ns < 0 ? -kNsPerUs / 2 : kNsPerUs / 2;
  const int64_t us = stamp.ns / kNsPerUs + (stamp.ns % kNsPerUs + half) / kNsPerUs;
  const int64_t whole = us / kUsPerS, rest = us % kUsPerS;
  return fmt::format("{}{}.{:06d}", us < 0 ? "-" : "", whole < 0 ? -whole : whole, rest < 0 ? -rest : rest);
}

std::string tum_line(Stamp stamp, const Se3d& T_map_cam) {
  const Vec3d& t = T_map_cam.translation;
  const Quatd q = quaternion_from(T_map_cam.rotation);
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", file_stamp(stamp), t.x, t.y,
                     t.z, q.x, q.y, q.z, q.w);
}

Result<TrajectoryWriter> TrajectoryWriter::create(const std::string& path) {
  auto file = OutputFile::create(path, OutputFile::Kind::stream);
  if (!file) return Error{file.error()};
  return TrajectoryWriter(std::move(*file));
}

TrajectoryWriter::TrajectoryWriter(OutputFile file) : file_(std::move(file)) {}

bool TrajectoryWriter::write(Stamp stamp, const Se3d& T_map_cam) {
  return file_.write(tum_line(stamp, T_map_cam));
}

}  // namespace stillmap
