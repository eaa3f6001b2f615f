#include "config/validate.hpp"

#include <algorithm>
#include <cmath>

#include "config/cpu_set.hpp"
#include "config/fields.hpp"

namespace stillmap {
namespace {

/// The voxels of a truncation band that fit into a block and its halo.
constexpr float kMaxTruncationVoxels = 24;
/// Trilinear gradients need a value on both sides of the surface.
constexpr float kMinTruncationVoxels = 4;

class Violations {
 public:
  void add(std::string line) { lines_.push_back(std::move(line)); }
  void unless(bool fine, std::string line) {
    if (!fine) add(std::move(line));
  }
  std::vector<std::string> take() { return std::move(lines_); }

 private:
  std::vector<std::string> lines_;
};

/// A float is held against the float nearest to the bound, so that the bound itself is inside.
template <class T>
bool in_range(T value, const Field& field) {
  if constexpr (std::is_same_v<T, float>)
    return value >= static_cast<float>(field.lowest) && value <= static_cast<float>(field.highest);
  else
    return static_cast<double>(value) >= field.lowest && static_cast<double>(value) <= field.highest;
}

bool in_range(const std::string& value, const Field& field) {
  return in_range(static_cast<double>(value.size()), field);
}
template <size_t N>
bool in_range(const std::array<float, N>& values, const Field& field) {
  return std::all_of(values.begin(), values.end(), [&](float value) { return in_range(value, field); });
}

void check_ranges(const Config& config, Violations& out) {
  for_each_field(config, [&](const Field& field, const auto& value) {
    if (!in_range(value, field))
      out.add(field.name() + " = " + value_text(field, value) + ": allowed " + bound_text(field.lowest) +
              " to " + bound_text(field.highest) + " (" + field.unit + ")");
  });
}

std::string setting(const char* name, float value) {
  return std::string(name) + " = " + float_text(value);
}

void check_camera(const CameraConfig& camera, Violations& out) {
  if (camera.fx > 0) {
    out.unless(camera.fy > 0, setting("camera.fy", camera.fy) + ": must be above 0 when camera.fx is set");
    out.unless(camera.cx > 0, setting("camera.cx", camera.cx) + ": must be above 0 when camera.fx is set");
    out.unless(camera.cy > 0, setting("camera.cy", camera.cy) + ": must be above 0 when camera.fx is set");
    return;
  }
  const std::pair<const char*, float> others[] = {
      {"camera.fy", camera.fy}, {"camera.cx", camera.cx}, {"camera.cy", camera.cy}, {"camera.k1", camera.k1},
      {"camera.k2", camera.k2}, {"camera.p1", camera.p1}, {"camera.p2", camera.p2}, {"camera.k3", camera.k3}};
  for (const auto& [name, value] : others)
    out.unless(value == 0, setting(name, value) + ": has no effect while camera.fx is 0; set camera.fx too");
}

void check_pose(const char* name, const std::array<float, 7>& T, Violations& out) {
  constexpr float kRounding = 0.01f;
  const float length = std::sqrt(T[3] * T[3] + T[4] * T[4] + T[5] * T[5] + T[6] * T[6]);
  out.unless(std::abs(length - 1.0f) <= kRounding,
             std::string(name) + ": the length of the quaternion is " + float_text(length) + ", must be 1");
}

/// Rules between the keys of the sonar. With kind none they have no effect, but for who waits for a stop.
void check_sonar(const SonarConfig& sonar, Violations& out) {
  const auto line = [](const char* name, int32_t number) {
    return std::string("sonar.") + name + " = " + std::to_string(number);
  };
  if (sonar.kind == SonarKind::none) {
    out.unless(sonar.stop_line < 0,
               line("stop_line", sonar.stop_line) + ": has no effect while sonar.kind is none");
    return;
  }
  const bool triggers = sonar.kind == SonarKind::hc_sr04;
  out.unless(!sonar.chip.empty(), "sonar.chip = \"\": expected a GPIO chip such as \"/dev/gpiochip0\"");
  out.unless(sonar.echo_line >= 0, line("echo_line", sonar.echo_line) + ": the sonar needs an echo line");
  out.unless(triggers == (sonar.trigger_line >= 0),
             line("trigger_line", sonar.trigger_line) +
                 (triggers ? ": sonar.kind = hc_sr04 needs a trigger line"
                           : ": has no effect with sonar.kind = pulse_width; set -1"));
  const std::pair<const char*, int32_t> lines[] = {
      {"trigger_line", sonar.trigger_line}, {"echo_line", sonar.echo_line}, {"stop_line", sonar.stop_line}};
  for (size_t i = 0; i < std::size(lines); ++i)
    for (size_t j = 0; j < i; ++j)
      out.unless(lines[i].second < 0 || lines[i].second != lines[j].second,
                 line(lines[i].first, lines[i].second) + ": is sonar." + lines[j].first + " as well");
  out.unless(sonar.min_m < sonar.max_m, setting("sonar.min_m", sonar.min_m) +
                                            ": must be below sonar.max_m = " + float_text(sonar.max_m));
  out.unless(sonar.stop_m <= sonar.max_m, setting("sonar.stop_m", sonar.stop_m) +
                                              ": must be at most sonar.max_m = " + float_text(sonar.max_m) +
                                              ", or it is never free to go");
  out.unless(sonar.stop_line < 0 || sonar.stop_m > sonar.min_m,
             setting("sonar.stop_m", sonar.stop_m) + ": must be above sonar.min_m = " +
                 float_text(sonar.min_m) + ", or sonar.stop_line never says stop");
  constexpr float kSlowestSound_m_s = 300;  // colder than it gets
  out.unless(!triggers || sonar.rate_hz * 2 * sonar.max_m < kSlowestSound_m_s,
             setting("sonar.rate_hz", sonar.rate_hz) + ": allowed below " +
                 float_text(kSlowestSound_m_s / (2 * sonar.max_m)) +
                 ", or an echo from sonar.max_m comes after the next trigger");
  out.unless(sonar.lost_s * sonar.rate_hz >= 2,
             setting("sonar.lost_s", sonar.lost_s) +
                 ": must be at least twice 1 / sonar.rate_hz = " + float_text(2 / sonar.rate_hz));
  out.unless(sonar.max_age_s * sonar.rate_hz >= 0.5f,
             setting("sonar.max_age_s", sonar.max_age_s) + ": must be at least half of 1 / sonar.rate_hz = " +
                 float_text(0.5f / sonar.rate_hz) + ", or there are frames that no reading speaks for");
}

void check_depth(const Config& config, Violations& out) {
  const DepthParams& depth = config.depth;
  out.unless(depth.min_m < depth.max_m, setting("depth.min_m", depth.min_m) +
                                            ": must be below depth.max_m = " + float_text(depth.max_m));
  out.unless(depth.invalid == InvalidDepth::ignore || depth.far_m > depth.max_m,
             setting("depth.far_m", depth.far_m) + ": with depth.invalid = \"complete\" it must be above " +
                 "depth.max_m = " + float_text(depth.max_m) +
                 ", or what is out of range becomes a surface there");
}

void check_track(const Config& config, Violations& out) {
  const TrackParams& track = config.track;
  out.unless(track.poor_inlier_ratio >= track.lost_inlier_ratio,
             setting("track.poor_inlier_ratio", track.poor_inlier_ratio) +
                 ": must be at least track.lost_inlier_ratio = " + float_text(track.lost_inlier_ratio));
  out.unless(track.inlier_m < config.map.truncation_m,
             setting("track.inlier_m", track.inlier_m) + ": must be below map.truncation_m = " +
                 float_text(config.map.truncation_m) + ", or every point counts as an inlier");
  int64_t iterations = track.iterations_fine;
  if (track.levels >= 2) iterations += track.iterations_middle;
  if (track.levels >= 3) iterations += track.iterations_coarse;
  out.unless(iterations > 0, "track.iterations_fine = " + std::to_string(track.iterations_fine) +
                                 ": at least one level of track.levels = " + std::to_string(track.levels) +
                                 " must have an iteration");
}

void check_map(const MapParams& map, Violations& out) {
  const float voxels = map.truncation_m / map.voxel_m;
  constexpr float kRounding = 1e-4f;
  const bool fine = voxels >= kMinTruncationVoxels - kRounding && voxels <= kMaxTruncationVoxels + kRounding;
  out.unless(fine, setting("map.truncation_m", map.truncation_m) + ": allowed " +
                       float_text(kMinTruncationVoxels * map.voxel_m) + " to " +
                       float_text(kMaxTruncationVoxels * map.voxel_m) +
                       " (4 to 24 times map.voxel_m = " + float_text(map.voxel_m) + ")");
}

void check_archive(const Config& config, Violations& out) {
  out.unless(config.archive.dir.empty() || config.map.free_space == FreeSpace::hierarchical,
             "archive.dir = \"" + config.archive.dir +
                 "\": wants map.free_space = \"hierarchical\"; dense free space would fill the disk");
}

void check_source(const SourceConfig& source, Violations& out) {
  out.unless(source.wait_s >= 0 || source.wait_s == -1,
             setting("source.wait_s", source.wait_s) + ": allowed 0 and above, or -1 for ever");
}

void check_record(const RecordConfig& record, Violations& out) {
  out.unless(record.map || record.map_every_s == 0,
             setting("record.map_every_s", record.map_every_s) + ": has no effect while record.map is false");
  out.unless(record.log || !record.frames, "record.frames = true: has no effect while record.log is false");
  out.unless(record.log_max_bytes >= 2 * record.log_file_bytes,
             setting("record.log_max_bytes", record.log_max_bytes) +
                 ": must be at least twice record.log_file_bytes = " + float_text(record.log_file_bytes));
}

void check_runtime(const RuntimeConfig& runtime, Violations& out) {
  for (const auto& [name, cpus] : {std::pair{"runtime.realtime_cpus", runtime.realtime_cpus},
                                   std::pair{"runtime.other_cpus", runtime.other_cpus}})
    out.unless(cpus.empty() || !parse_cpus(cpus).empty(),
               std::string(name) + " = \"" + cpus + "\": expected a set of CPUs such as \"0,2-3\"");
}

}  // namespace

std::vector<std::string> violations(const Config& config) {
  Violations out;
  check_ranges(config, out);
  check_camera(config.camera, out);
  check_source(config.source, out);
  check_pose("mount.T_body_cam", config.mount.T_body_cam, out);
  check_pose("sonar.T_cam_sonar", config.sonar.T_cam_sonar, out);
  check_sonar(config.sonar, out);
  check_depth(config, out);
  check_track(config, out);
  check_map(config.map, out);
  check_archive(config, out);
  check_record(config.record, out);
  check_runtime(config.runtime, out);
  return out.take();
}

std::string camera_problem(const CameraModel& camera) {
  const Intrinsics& k = camera.k;
  const Distortion& d = camera.distortion;
  for (const float value : {k.fx, k.fy, k.cx, k.cy, d.k1, d.k2, d.p1, d.p2, d.k3})
    if (!std::isfinite(value)) return "intrinsics must be finite numbers";
  if (!(k.fx > 0) || !(k.fy > 0))
    return "focal length fx = " + float_text(k.fx) + ", fy = " + float_text(k.fy) + " must be above 0 pixels";
  if (k.width <= 0 || k.height <= 0) return {};
  const bool inside =
      k.cx > 0 && k.cy > 0 && k.cx < static_cast<float>(k.width) && k.cy < static_cast<float>(k.height);
  if (inside) return {};
  return "centre cx = " + float_text(k.cx) + ", cy = " + float_text(k.cy) + " lies outside the image of " +
         std::to_string(k.width) + "x" + std::to_string(k.height) + " pixels";
}

}  // namespace stillmap
