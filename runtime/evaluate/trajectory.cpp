#include "runtime/evaluate/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
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

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// A decimal number taken apart: 0.DIGITS * 10^point.
struct Decimal {
  bool negative = false;
  std::string digits;  ///< without leading zeros
  int64_t point = 0;
};

/// Power of ten after an `e`; saturates far outside of any use.
std::optional<int64_t> parse_exponent(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  int64_t exponent = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), exponent);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return std::clamp<int64_t>(exponent, -10000, 10000);
}

std::optional<Decimal> parse_decimal(std::string_view text) {
  Decimal d;
  if (!text.empty() && (text.front() == '-' || text.front() == '+')) {
    d.negative = text.front() == '-';
    text.remove_prefix(1);
  }
  bool any_digit = false, after_point = false;
  std::size_t i = 0;
  for (; i < text.size() && (is_digit(text[i]) || (text[i] == '.' && !after_point)); ++i) {
    if (text[i] == '.') {
      after_point = true;
      continue;
    }
    any_digit = true;
    const bool significant = text[i] != '0' || !d.digits.empty();
    if (significant) d.digits.push_back(text[i]);
    if (!after_point && significant) ++d.point;
    if (after_point && !significant) --d.point;
  }
  if (!any_digit) return std::nullopt;
  if (i == text.size()) return d;
  if (text[i] != 'e' && text[i] != 'E') return std::nullopt;
  const std::optional<int64_t> exponent = parse_exponent(text.substr(i + 1));
  if (!exponent) return std::nullopt;
  d.point += *exponent;
  return d;
}

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
  if (!stamp) return Error{fmt::format("stamp '{}' is no number of seconds within +-9.2e9", columns[0])};
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

std::optional<Stamp> parse_stamp(std::string_view text) {
  const std::optional<Decimal> decimal = parse_decimal(text);
  if (!decimal) return std::nullopt;
  if (decimal->digits.empty()) return Stamp{0};
  const int64_t digits_ns = decimal->point + 9;  // digits before the point of the number in nanoseconds
  if (digits_ns > 19) return std::nullopt;
  if (digits_ns < 0) return Stamp{0};
  std::string whole = decimal->digits.substr(0, static_cast<std::size_t>(digits_ns));
  whole.resize(static_cast<std::size_t>(digits_ns), '0');
  uint64_t ns = 0;
  for (const char c : whole) ns = ns * 10 + static_cast<uint64_t>(c - '0');
  const std::size_t next = static_cast<std::size_t>(digits_ns);
  if (next < decimal->digits.size() && decimal->digits[next] >= '5') ++ns;
  constexpr uint64_t kLimit_ns = 9'200'000'000'000'000'000;
  if (ns > kLimit_ns) return std::nullopt;
  const int64_t magnitude = static_cast<int64_t>(ns);
  return Stamp{decimal->negative ? -magnitude : magnitude};
}

double exact_seconds(Stamp stamp) {
  // By way of the text: dividing in any wider type rounds twice and misses now and then.
  return parse_number(stamp_text(stamp)).value_or(0);
}

std::string stamp_text(Stamp stamp) {
  const uint64_t ns = static_cast<uint64_t>(stamp.ns < 0 ? -stamp.ns : stamp.ns);
  return fmt::format("{}{}.{:09}", stamp.ns < 0 ? "-" : "", ns / 1'000'000'000, ns % 1'000'000'000);
}

std::optional<double> parse_number(std::string_view text) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
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
