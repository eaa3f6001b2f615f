#include "firmware-like/commands/run_options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/engines.hpp"
#include "runtime/evaluate/trajectory.hpp"

namespace stillmap {
namespace {

Error usage(const std::string& message) {
  return {message, ErrorKind::bad_usage};
}

/// The numbers of a list parted by commas, or nothing when one of them is none.
std::optional<std::vector<float>> numbers(const std::string& text) {
  std::vector<float> values;
  for (size_t from = 0; from <= text.size();) {
    const size_t comma = std::min(text.find(',', from), text.size());
    const auto value = parse_number(std::string_view(text).substr(from, comma - from));
    if (!value || std::abs(*value) > static_cast<double>(std::numeric_limits<float>::max())) return {};
    values.push_back(static_cast<float>(*value));
    from = comma + 1;
  }
  return values;
}

/// Flags that set one number of the configuration. @return the error, or empty
std::string apply_number(const std::string& flag, const std::string& text, double min, double max,
                         auto& target) {
  if (text.empty()) return {};
  const auto value = parse_number(text);
  if (value && *value >= min && *value <= max) {
    target = static_cast<std::remove_reference_t<decltype(target)>>(*value);
    if (static_cast<double>(target) == *value ||
        !std::is_integral_v<std::remove_reference_t<decltype(target)>>)
      return {};
  }
  return fmt::format("{} {}: expected a number from {} to {}", flag, text, min, max);
}

}  // namespace

void declare_run_flags(CLI::App& command, RunOptions& o) {
  command
      .add_option(
          "--source", o.source,
          "xtion[:SERIAL], oni:FILE, v4l2:DEPTH_DEV[,COLOUR_DEV], tum:DIR, sevenscenes:DIR, log:FILE or "
          "synthetic:SCENE[,seed=N][,size=WxH][,seconds=S]")
      ->required();
  command.add_option("--config", o.config, "TOML file (default: the built-in default preset)");
  command.add_option("--out", o.out, "folder for trajectory, mesh and report; without it nothing is written");
  command.add_option("--map", o.map, "go on with this saved map (map.smap): the camera is looked for in it");
  command.add_option("--device", o.device, "auto, cuda or cpu")
      ->check(CLI::IsMember({"auto", "cuda", "cpu"}))
      ->capture_default_str();
  command.add_option("--threads", o.threads, "threads of the CPU engine, 1..64");
  command.add_option("--camera", o.camera,
                     "FX,FY,CX,CY[,K1,K2,P1,P2,K3] in pixels, instead of what the source says");
  command.add_option("--depth-scale", o.depth_scale, "raw depth units in a metre");
  command.add_option("--time-offset-ms", o.time_offset_ms, "added to the colour stamp before pairing");
  command.add_option("--max-frames", o.max_frames, "stop after so many frames (0: all)");
  command.add_option("--skip-frames", o.skip_frames, "pass over the first frames");
  command.add_flag("--realtime", o.realtime, "at the pace of the stamps, newest first");
  command.add_option("--lcm", o.lcm,
                     "LCM URL or off (default: live udpm://239.255.76.67:7667?ttl=0, else off)");
  command.add_option("--initial-pose", o.initial_pose,
                     "X,Y,Z,QX,QY,QZ,QW of the first frame, camera to map; with --map the first guess");
  command.add_option("--set", o.settings, "section.key=value, over the configuration file; may be repeated")
      ->allow_extra_args(false);
  command.add_flag("--quiet", o.quiet, "no progress, no summary");
}

Result<Done> apply_camera(Config& config, const std::string& text) {
  const auto values = numbers(text);
  if (!values || values->size() < 4 || values->size() > 9)
    return usage("--camera " + text + ": expected FX,FY,CX,CY[,K1,K2,P1,P2,K3], four to nine finite numbers");
  CameraConfig& c = config.camera;
  float* const fields[] = {&c.fx, &c.fy, &c.cx, &c.cy, &c.k1, &c.k2, &c.p1, &c.p2, &c.k3};
  for (size_t i = 0; i < std::size(fields); ++i) *fields[i] = i < values->size() ? (*values)[i] : 0;
  if (c.fx <= 0 || c.fy <= 0)
    return usage("--camera " + text + ": the focal lengths FX and FY must be greater than 0 pixels");
  return Done{};
}

Result<RunPlan> plan_run(const RunOptions& o) {
  if (const std::string missing = cuda_refused(o.device); !missing.empty()) return usage(missing);
  auto config = read_config(o.config, o.settings);
  if (!config) return usage(config.error());
  RunPlan plan{*config, {}};
  if (!o.camera.empty())
    if (const auto camera = apply_camera(plan.config, o.camera); !camera) return usage(camera.error());
  for (const std::string& error :
       {apply_number("--threads", o.threads, 1, 64, plan.config.runtime.threads),
        apply_number("--depth-scale", o.depth_scale, 1e-3, 1e6, plan.config.camera.depth_units_per_m),
        apply_number("--time-offset-ms", o.time_offset_ms, -1e4, 1e4, plan.config.source.time_offset_ms)})
    if (!error.empty()) return usage(error);
  if (!o.initial_pose.empty()) {
    const auto pose = parse_pose(o.initial_pose);
    if (!pose) return usage("--initial-pose " + o.initial_pose + ": " + pose.error());
    plan.T_map_cam = *pose;
  }
  if (const auto good = check(plan.config); !good) return usage(good.error());
  return plan;
}

}  // namespace stillmap
