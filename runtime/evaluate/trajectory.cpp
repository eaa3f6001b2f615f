#include "runtime/evaluate/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>

namespace stillmap {
namespace {

constexpr std::size_t kMaxLineBytes = 4096;
constexpr uintmax_t kMaxFileBytes = uintmax_t{1} << 30;
constexpr double kMaxPosition_m = 1e7;
constexpr std::size_t kColumns = 8;
constexpr double kMinQuaternionNorm = 1e-6;

/// Next column of `line`, which loses it; empty at the end.
std::string_view take_column(std::string_view& line) {
  constexpr std::string_view kSeparators = " \t,\r";
  const std::size_t begin = line.find_first_not_of(kSeparators);
  if (begin == std::string_view::npos) return line = {};
  const std::size_t end = std::min(line.find_first_of(kSeparators, begin), line.size());
  const std::string_view column = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return column;
}

/// Position and quaternion, in the order of the TUM format; the problem in words if they are no pose.
Result<Se3d> pose_from(const std::array<double, 7>& v) {
  for (std::size_t i = 0; i < 3; ++i)
    if (std::abs(v[i]) > kMaxPosition_m) return Error{fmt::format("position {} is beyond 1e7 m", v[i])};
  const double length = std::hypot(std::hypot(v[3], v[4]), std::hypot(v[5], v[6]));
  if (!(length > kMinQuaternionNorm) || !std::isfinite(length))
    return Error{"the quaternion has no usable length; expected qx qy qz qw of length 1"};
  const Quatd q = {v[3] / length, v[4] / length, v[5] / length, v[6] / length};
  return Se3d{rotation_from(q), {v[0], v[1], v[2]}};
}

Result<TimedPose> parse_line(std::string_view line) {
  std::array<std::string_view, kColumns> columns;
  std::size_t count = 0;
  for (std::string_view column = take_column(line); !column.empty(); column = take_column(line)) {
    if (count < kColumns) columns[count] = column;
    ++count;
  }
  if (count != kColumns)
    return Error{fmt::format("has {} columns; expected 8: stamp tx ty tz qx qy qz qw", count)};
  const std::optional<Stamp> stamp = parse_stamp(columns[0]);
  if (!stamp) return Error{fmt::format("stamp '{}' is no number of seconds within 100 years", columns[0])};
  std::array<double, 7> values{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::optional<double> value = parse_number(columns[i + 1]);
    if (!value) return Error{fmt::format("column {}, '{}', is no finite number", i + 2, columns[i + 1])};
    values[i] = *value;
  }
  const Result<Se3d> pose = pose_from(values);
  if (!pose) return Error{pose.error()};
  return TimedPose{*stamp, *pose};
}

void sort_and_merge(Trajectory& trajectory) {
  std::vector<TimedPose>& poses = trajectory.poses;
  const auto earlier = [](const TimedPose& a, const TimedPose& b) { return a.stamp < b.stamp; };
  std::stable_sort(poses.begin(), poses.end(), earlier);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const bool repeated = kept > 0 && poses[kept - 1].stamp == poses[i].stamp;
    if (repeated) ++trajectory.repeated_stamps;
    poses[repeated ? kept - 1 : kept++] = poses[i];
  }
  poses.resize(kept);
}

}  // namespace

double exact_seconds(Stamp stamp) {
  // By way of the text: dividing in any wider type rounds twice and misses now and then.
  return parse_number(stamp_text(stamp)).value_or(0);
}

std::string stamp_text(Stamp stamp) {
  const uint64_t ns = static_cast<uint64_t>(stamp.ns < 0 ? -stamp.ns : stamp.ns);
  return fmt::format("{}{}.{:09}", stamp.ns < 0 ? "-" : "", ns / 1'000'000'000, ns % 1'000'000'000);
}

Result<Trajectory> read_trajectory(const std::string& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code))
    return Error{fmt::format("{}: is a folder; expected a trajectory file in the TUM format", path)};
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return Error{fmt::format("{}: cannot be opened: {}; expected a trajectory file in the TUM format", path,
                             std::strerror(errno))};
  const uintmax_t bytes = std::filesystem::file_size(path, code);
  if (!code && bytes > kMaxFileBytes) return Error{fmt::format("{}: larger than 1 GiB, no trajectory", path)};
  Trajectory trajectory;
  std::array<char, kMaxLineBytes + 2> buffer;
  for (uint64_t number = 1; file.getline(buffer.data(), buffer.size()) || file.gcount() > 0; ++number) {
    if (file.fail() && !file.eof())
      return Error{
          fmt::format("{}:{}: the line is longer than {} bytes, no trajectory", path, number, kMaxLineBytes)};
    std::string_view line(buffer.data());
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r,") == std::string_view::npos) continue;
    const Result<TimedPose> pose = parse_line(line);
    if (!pose) return Error{fmt::format("{}:{}: {}", path, number, pose.error())};
    trajectory.poses.push_back(*pose);
  }
  if (trajectory.poses.empty())
    return Error{fmt::format("{}: holds no pose; expected lines of stamp tx ty tz qx qy qz qw", path)};
  sort_and_merge(trajectory);
  return trajectory;
}

Result<Se3d> parse_pose(std::string_view text) {
  std::array<double, 7> values{};
  const std::string whole(text);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::optional<double> value = parse_number(take_column(text));
    if (!value) return Error{fmt::format("pose '{}': expected seven numbers X,Y,Z,QX,QY,QZ,QW", whole)};
    values[i] = *value;
  }
  if (!take_column(text).empty()) return Error{fmt::format("pose '{}': more than seven numbers", whole)};
  const Result<Se3d> pose = pose_from(values);
  if (!pose) return Error{fmt::format("pose '{}': {}", whole, pose.error())};
  return *pose;
}

}  // namespace stillmap
