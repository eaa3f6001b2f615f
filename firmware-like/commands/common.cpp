#include "firmware-like/commands/common.hpp"

#include <cstdio>

#include "config/load.hpp"
#include "config/validate.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/engines.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "firmware-like/journal.hpp"
#include "runtime/archive/map_saver.hpp"
#include "runtime/record/log_recorder.hpp"

namespace stillmap {

int fail(const std::string& message, ErrorKind kind) {
  std::fflush(stdout);
  say(Priority::error, message);
  switch (kind) {
    case ErrorKind::failed:
      return kExitFailed;
    case ErrorKind::bad_usage:
      return kExitUsage;
    case ErrorKind::cannot_open:
      return kExitNoSource;
  }
  return kExitFailed;
}

Result<Config> read_config(const std::string& path, const std::vector<std::string>& settings) {
  Config config;
  if (!path.empty()) {
    auto loaded = load_config(path);
    if (!loaded) return Error{loaded.error(), ErrorKind::bad_usage};
    config = *loaded;
  }
  std::string problems;
  for (const std::string& setting : settings)
    if (const auto done = apply_setting(config, setting); !done)
      problems += (problems.empty() ? "" : "\n  ") + done.error();
  if (!problems.empty()) return Error{problems, ErrorKind::bad_usage};
  return config;
}

Result<Done> check(const Config& config) {
  std::string text;
  for (const std::string& violation : violations(config)) text += "\n  " + violation;
  if (text.empty()) return Done{};
  return Error{"the configuration cannot be used:" + text, ErrorKind::bad_usage};
}

Result<Calibration> configured_calibration(const Config& config) {
  if (config.camera.calibration.empty()) return Calibration{};
  const auto file = find_calibration(config.camera.calibration);
  if (!file) return Error{file.error(), file.error_kind()};
  return load_calibration(*file);
}

SourceOptions source_options(const Config& config) {
  SourceOptions options;
  const CameraConfig& c = config.camera;
  if (c.fx > 0)
    options.dataset.camera = CameraModel{{c.fx, c.fy, c.cx, c.cy, 0, 0}, {c.k1, c.k2, c.p1, c.p2, c.k3}};
  options.dataset.depth_units_per_m = c.depth_units_per_m;
  options.dataset.calibration = c.calibration;
  options.dataset.time_offset_ms = static_cast<double>(config.source.time_offset_ms);
  options.dataset.max_pair_ms = static_cast<double>(config.source.max_pair_ms);
  const SourceConfig& source = config.source;
  options.camera = {.cols = source.cols,
                    .rows = source.rows,
                    .rate_hz = source.rate_hz,
                    .auto_exposure = c.auto_exposure,
                    .auto_white_balance = c.auto_white_balance,
                    .max_pair_ms = options.dataset.max_pair_ms,
                    .time_offset_ms = options.dataset.time_offset_ms,
                    .gone_s = static_cast<double>(source.gone_s),
                    .camera = options.dataset.camera,
                    .depth_units_per_m = c.depth_units_per_m};
  options.threads = config.runtime.threads;
  return options;
}

namespace {

/// Of map.high_water: between them there is room for what comes while the archive writes.
constexpr float kArchiveBelow = 0.85f, kArchiveFull = 0.95f;

}  // namespace

BlockArchive::Options archive_options(const Config& config) {
  BlockArchive::Options options;
  options.dir = config.archive.dir;
  options.max_bytes = static_cast<uint64_t>(config.archive.max_bytes);
  options.keep_below = kArchiveBelow * config.map.high_water;
  options.full = kArchiveFull * config.map.high_water;
  return options;
}

MemoryPlan plan_memory(const Config& config, const EngineParams& params, const std::string& device) {
  MemoryPlan plan = memory_plan(config, params.camera, plan_engine(device, params));
  if (!config.archive.dir.empty())
    plan.add("archive: groups on their way", BlockArchive::planned_bytes(archive_options(config)));
  if (config.record.map)
    plan.add("map on its way to disk", MapSaver::planned_bytes(plan_group_capacity(params)));
  if (config.record.log)
    plan.add("event log",
             LogRecorder::planned_bytes(config.record, params.camera.k.height, params.camera.k.width));
  return plan;
}

PreloadedFrames preload(FrameSource& source, int32_t count) {
  PreloadedFrames slots;
  while (static_cast<int32_t>(slots.size()) < count && !stop_requested()) {
    auto slot = std::make_unique<FrameSlot>(source.info());
    const Status status = source.next(slot->frame(), 1000);
    if (status == Status::ok) slots.push_back(std::move(slot));
    if (status == Status::end || status == Status::unavailable) break;
  }
  return slots;
}

}  // namespace stillmap
