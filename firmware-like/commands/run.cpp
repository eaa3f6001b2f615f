#include "firmware-like/commands/run.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "config/engine_params.hpp"
#include "config/memory_plan.hpp"
#include "drivers/registry.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/engines.hpp"
#include "firmware-like/commands/progress.hpp"
#include "firmware-like/commands/run_loop.hpp"
#include "firmware-like/commands/run_options.hpp"
#include "firmware-like/commands/run_outputs.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_file.hpp"
#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

/// Opens the source, waiting source.wait_s for it to appear.
Result<std::unique_ptr<FrameSource>> open_waiting(const std::string& name, const Config& config) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const double wait_s = static_cast<double>(config.source.wait_s);
  while (true) {
    auto source = open_source(name, source_options(config));
    const double waited_s = std::chrono::duration<double>(Clock::now() - start).count();
    const bool wait_on = wait_s < 0 || waited_s < wait_s;
    if (source || source.error_kind() != ErrorKind::cannot_open || !wait_on || stop_requested())
      return source;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

/// The map to go on with, found whole and fit for this configuration; none where none was asked for.
Result<std::optional<MapFile>> open_map(const std::string& path, const Config& config) {
  if (path.empty()) return std::optional<MapFile>();
  auto file = MapFile::open(path);
  if (!file) return Error{"--map " + file.error(), file.error_kind()};
  if (const auto fits = file->check_against(config); !fits)
    return Error{"--map " + fits.error(), fits.error_kind()};
  return std::optional<MapFile>(std::move(*file));
}

std::string map_text(const std::string& path, const MapFile& file, const LoadedMap& loaded) {
  std::string text = fmt::format("{}: {} groups of blocks, {} keyframes, written by stillmap {}", path,
                                 file.contents().groups, loaded.places, file.info().program_version);
  if (loaded.foreign_places > 0)
    text += fmt::format("; {} keyframes of another image size or relocalise.ferns are of no use here",
                        loaded.foreign_places);
  return text;
}

/// Frames that will be read, -1 when nobody knows.
int64_t expected_frames(const SourceInfo& info, const RunOptions& o) {
  if (info.frames < 0) return o.max_frames > 0 ? o.max_frames : -1;
  const int64_t left = std::max<int64_t>(info.frames - o.skip_frames, 0);
  return o.max_frames > 0 ? std::min<int64_t>(left, o.max_frames) : left;
}

void print_summary(const RunOptions& o, const RunOutputs& outputs, const PipelineCounters& counters,
                   double seconds) {
  const Report& report = outputs.report();
  fmt::print("{} frames in {:.1f} s; a frame takes {:.1f} ms (median), {:.1f} ms (95 %)\n", counters.frames,
             seconds, report.total_ms().percentile(0.5), report.total_ms().percentile(0.95));
  fmt::print("lost {}, skipped {}, masked {:.1f} % of the pixels on average, peak memory {:.0f} MB\n",
             counters.lost_frames, outputs.fault_count("bad_frame"), 100 * report.masked_fraction_mean(),
             static_cast<double>(peak_rss_bytes()) * 1e-6);
  if (o.out.empty())
    fmt::print("nothing was written; --out DIR keeps trajectory, mesh and report\n");
  else
    fmt::print("{0}/trajectory.txt, {0}/report.json{1}; `stillmap picture {0}` draws them\n", o.out,
               outputs.mesh_triangles() > 0 ? fmt::format(", {}/mesh.ply ({} triangles in {:.1f} s)", o.out,
                                                          outputs.mesh_triangles(), outputs.mesh_seconds())
                                            : "");
  if (outputs.map_bytes() > 0)
    fmt::print("{}/map.smap ({:.1f} MB in {:.1f} s); `stillmap run --map` goes on with it\n", o.out,
               static_cast<double>(outputs.map_bytes()) * 1e-6, outputs.map_seconds());
}

int exit_code_of(const LoopEnd& end, const RunOutputs& outputs, const PipelineCounters& counters) {
  if (!end.error.empty()) return fail(end.error, ErrorKind::failed);
  if (outputs.failed()) return fail("not everything could be written, see above", ErrorKind::failed);
  if (counters.frames == 0 && !stop_requested())
    return fail("no frame of the source could be used", ErrorKind::failed);
  if (end.state == TrackingState::lost) {
    std::fprintf(stderr, "stillmap: tracking was lost and not found again before the end\n");
    return kExitLost;
  }
  return kExitDone;
}

}  // namespace

int run(const RunOptions& o, FrameObserver* observer) {
  catch_stop_signals();
  const auto plan = plan_run(o);
  if (!plan) return fail(plan.error(), plan.error_kind());
  const Config& config = plan->config;

  auto map = open_map(o.map, config);
  if (!map) return fail(map.error(), map.error_kind());

  auto opened = open_waiting(o.source, config);
  if (!opened) return stop_requested() ? kExitDone : fail(opened.error(), opened.error_kind());
  FrameSource& source = **opened;
  source.skip(o.skip_frames);

  const EngineParams params = engine_params(config, source.info().camera, source.info().depth_units_per_m);
  const std::string device = pick_device(o.device, o.quiet);
  const MemoryPlan memory = plan_memory(config, params, device);
  if (const auto fits = check_budget(memory); !fits) return fail(fits.error(), fits.error_kind());
  const std::unique_ptr<Engine> engine = make_engine(device, params);
  if (!engine)
    return fail(
        fmt::format("the {} MB of the memory plan cannot be had from this machine; lower map.pool_blocks",
                    memory.total_bytes / 1000000),
        ErrorKind::failed);

  std::unique_ptr<BlockArchive> archive;
  if (!config.archive.dir.empty()) {
    auto made = BlockArchive::open(archive_options(config));
    if (!made) return fail(made.error(), ErrorKind::failed);
    archive = std::move(*made);
  }
  std::string loaded_text;
  if (MapFile* const file = map->has_value() ? &**map : nullptr) {
    const auto loaded = file->load(*engine, archive.get());
    if (!loaded) return fail("--map " + loaded.error(), loaded.error_kind());
    loaded_text = map_text(o.map, *file, *loaded);
  }

  SourceInfo info = source.info();
  info.camera = params.camera;
  const int64_t frames = expected_frames(info, o);
  auto outputs =
      RunOutputs::create(o.out, config, info, frames, Report(device, params.threads, memory.total_bytes));
  if (!outputs) return fail(outputs.error(), ErrorKind::failed);
  (*outputs)->event(Stamp{}, "start",
                    fmt::format("{}, {} engine, {} threads", info.name, device, params.threads));

  if (!loaded_text.empty()) (*outputs)->event(Stamp{}, "map_load", loaded_text);
  (*outputs)->prepare_map(*engine, archive.get());

  if (observer) observer->begin(source, info);
  FrameSlot slot(info);
  Pipeline pipeline(*engine, config, plan->T_map_cam, source.odometry());
  if (map->has_value())
    pipeline.start_lost(o.initial_pose.empty() ? (*map)->info().T_map_cam : plan->T_map_cam);
  Progress progress(frames, o.quiet);
  const LoopLimits limits = {o.max_frames, static_cast<double>(config.lost.new_map_after_s)};
  const LoopEnd end =
      run_loop(source, *engine, pipeline, **outputs, progress, slot.frame(), limits, observer, archive.get());
  const double seconds = progress.seconds();
  (*outputs)->finish(*engine, source, pipeline.counters(), archive.get());
  if (!o.quiet) print_summary(o, **outputs, pipeline.counters(), seconds);
  std::fflush(stdout);
  return exit_code_of(end, **outputs, pipeline.counters());
}

void add_run(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("run", "track and map a camera or a recording");
  auto options = std::make_shared<RunOptions>();
  declare_run_flags(*command, *options);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace stillmap
