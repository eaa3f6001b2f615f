#include "firmware-like/commands/run.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "config/describe.hpp"
#include "config/engine_params.hpp"
#include "config/memory_plan.hpp"
#include "drivers/gpio/gpio_sonar.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/registry.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/engines.hpp"
#include "firmware-like/commands/progress.hpp"
#include "firmware-like/commands/run_options.hpp"
#include "firmware-like/commands/run_outputs.hpp"
#include "firmware-like/commands/snapshots.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "firmware-like/journal.hpp"
#include "firmware-like/metrics_server.hpp"
#include "firmware-like/systemd.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_file.hpp"
#include "runtime/core/clock.hpp"
#include "runtime/core/heap_guard.hpp"
#include "runtime/core/version.hpp"
#include "runtime/executive/executive.hpp"
#include "runtime/executive/looped_source.hpp"
#include "runtime/executive/paced_source.hpp"

namespace stillmap {
namespace {

constexpr const char* kMapFile = "map.smap";

/// What a run tells the network, and hears from it. Empty where --lcm is off.
struct Lcm {
  std::unique_ptr<MessageCodec> codec;
  std::unique_ptr<MessageBus> bus;
  std::unique_ptr<CommandPort> commands;
  std::unique_ptr<OdometryPort> odometry;

  void say_boot(int64_t utc_us) const {
    if (!bus) return;
    StatusMessage status;
    status.utime.us = utc_us;
    uint8_t bytes[kDatagramBytes];
    const uint32_t size = codec->encode(status, View<uint8_t>{bytes, kDatagramBytes});
    bus->publish(kStatusChannel, View<const uint8_t>{bytes, size});  // not sent: there is a next one
  }
};

Result<Lcm> open_lcm(const RunOptions& o, const Config& config, const UtcClock& clock, bool live) {
  Lcm lcm;
  const std::string url = !o.lcm.empty() ? o.lcm : live ? kLcmDefaultUrl : "off";
  lcm.codec = make_lcm_codec();
  if (url == "off") return lcm;
  auto bus = open_lcm_bus(url);
  if (!bus) return Error{"--lcm " + bus.error(), bus.error_kind()};
  lcm.bus = std::move(*bus);
  if (config.lcm.commands) {
    auto commands = open_lcm_commands(url);
    if (!commands) return Error{"--lcm " + commands.error(), commands.error_kind()};
    lcm.commands = std::move(*commands);
  }
  if (config.track.prior == MotionPrior::odometry) {
    auto odometry = open_lcm_odometry(url, [&clock](Utime t) { return Stamp{clock.to_monotonic_ns(t.us)}; });
    if (!odometry) return Error{"--lcm " + odometry.error(), odometry.error_kind()};
    lcm.odometry = std::move(*odometry);
  }
  return lcm;
}

/// Opens the source, waiting source.wait_s for it to appear. Until then the program is in mode boot, and says
/// so to whoever started it and to the network.
Result<std::unique_ptr<FrameSource>> open_waiting(const std::string& name, const Config& config,
                                                  ServiceManager* service, const Lcm& lcm,
                                                  const UtcClock& clock) {
  constexpr std::chrono::milliseconds kTry{200};
  const double wait_s = static_cast<double>(config.source.wait_s);
  const int64_t start_ns = monotonic_ns();
  for (bool waiting = false;; waiting = true) {
    auto source = open_source(name, source_options(config));
    const int64_t now_ns = monotonic_ns();
    const bool wait_on = wait_s < 0 || static_cast<double>(now_ns - start_ns) * 1e-9 < wait_s;
    if (source || source.error_kind() != ErrorKind::cannot_open || !wait_on || stop_requested())
      return source;
    if (service && !waiting) {
      service->ready();
      service->say("boot: waiting for " + name);
    }
    if (service) service->alive();
    lcm.say_boot(clock.to_utc_us(now_ns));
    std::this_thread::sleep_for(kTry);
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
  if (info.frames < 0) return o.max_frames > 0 ? int64_t{o.max_frames} : -1;
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

int exit_code_of(const RunEnd& end, const RunOutputs& outputs, const PipelineCounters& counters) {
  if (!end.error.empty()) return fail(end.error, ErrorKind::failed);
  if (outputs.failed()) return fail("not everything could be written, see above", ErrorKind::failed);
  if (counters.frames == 0 && !stop_requested())
    return fail("no frame of the source could be used", ErrorKind::failed);
  if (end.state == TrackingState::lost) {
    say(Priority::error, "tracking was lost and not found again before the end");
    return kExitLost;
  }
  return kExitDone;
}

/// Null: there is none, or the frames are of another time than now.
Result<std::unique_ptr<RangeSensor>> make_sonar(const SonarConfig& sonar, bool live) {
  if (sonar.kind == SonarKind::none || !live) return std::unique_ptr<RangeSensor>();
  return make_gpio_sonar(sonar);
}

Result<std::unique_ptr<BlockArchive>> open_archive(const Config& config) {
  if (config.archive.dir.empty()) return std::unique_ptr<BlockArchive>();
  return BlockArchive::open(archive_options(config));
}

/// A copy of the map that was just saved under a name inside the folder of the run. @return the error, or
/// empty
std::string copy_map(const RunFolder& folder, const std::string& file) {
  std::error_code error;
  const std::string part = folder.path(file) + ".part";
  std::filesystem::copy_file(folder.path(kMapFile), part, std::filesystem::copy_options::overwrite_existing,
                             error);
  if (!error) std::filesystem::rename(part, folder.path(file), error);
  return error ? folder.path(file) + ": " + error.message() : std::string();
}

/// What a replay has to know of the run.
SessionMessage session_of(const FrameSource& source, const RunPlan& plan, const RunOptions& o,
                          const std::optional<MapFile>& map, const std::string& config_toml,
                          const UtcClock& clock) {
  const CameraModel& camera = source.info().camera;
  const auto wide = [](float x) { return static_cast<double>(x); };
  SessionMessage session;
  session.utime.us = clock.to_utc_us(monotonic_ns());
  session.version = version();
  session.source = source.info().name;
  session.config_toml = config_toml;
  session.width = camera.k.width;
  session.height = camera.k.height;
  const float k[] = {camera.k.fx, camera.k.fy, camera.k.cx, camera.k.cy};
  std::transform(std::begin(k), std::end(k), session.k, wide);
  const Distortion& d = camera.distortion;
  const float distortion[] = {d.k1, d.k2, d.p1, d.p2, d.k3};
  std::transform(std::begin(distortion), std::end(distortion), session.distortion, wide);
  session.depth_units_per_m = wide(source.info().depth_units_per_m);
  session.T_map_cam = map && o.initial_pose.empty() ? map->info().T_map_cam : plan.T_map_cam;
  session.map = o.map;
  std::transform(std::begin(source.info().depth_bias.c), std::end(source.info().depth_bias.c),
                 session.depth_bias, wide);
  return session;
}

/// All of a run but its source, which is open.
int run_with(FrameSource& source, const RunOptions& o, const RunPlan& plan, std::optional<MapFile>& map,
             Lcm& lcm, UtcClock& clock, ServiceManager* service, FrameObserver* observer) {
  const Config& config = plan.config;
  EngineParams params =
      engine_params(config, source.info().camera, source.info().depth_units_per_m, source.info().depth_bias);
  params.on_worker = heap_guard::arm_worker;
  const std::string device = pick_device(o.device, o.quiet);
  MemoryPlan memory = plan_memory(config, params, device);
  if (source.info().registration_bytes > 0) memory.add(kRegistrationEntry, source.info().registration_bytes);
  if (const auto fits = check_budget(memory); !fits) return fail(fits.error(), fits.error_kind());
  const std::unique_ptr<Engine> engine = make_engine(device, params);
  if (!engine)
    return fail(
        fmt::format("the {} MB of the memory plan cannot be had from this machine; lower map.pool_blocks",
                    memory.total_bytes / 1000000),
        ErrorKind::failed);
  auto archive = open_archive(config);
  if (!archive) return fail(archive.error(), ErrorKind::failed);
  std::string loaded_text;
  if (map) {
    const auto loaded = map->load(*engine, archive->get());
    if (!loaded) return fail("--map " + loaded.error(), loaded.error_kind());
    loaded_text = map_text(o.map, *map, *loaded);
  }

  SourceInfo info = source.info();
  info.camera = params.camera;
  const bool live = o.realtime || is_camera(o.source);
  auto sonar = make_sonar(config.sonar, live);
  if (!sonar) return fail(sonar.error(), sonar.error_kind());
  std::unique_ptr<MetricsServer> metrics;
  if (config.metrics.port > 0) {
    auto server = MetricsServer::open(config.metrics.port);
    if (!server) return fail(server.error(), server.error_kind());
    metrics = std::move(*server);
  }
  const int64_t frames = expected_frames(info, o);
  auto made =
      RunOutputs::create(o.out, config, info, frames, Report(device, params.threads, memory.total_bytes));
  if (!made) return fail(made.error(), ErrorKind::failed);
  RunState state;
  RunOutputs& outputs = **made;
  outputs.event(Stamp{}, "start",
                fmt::format("{}, {} engine, {} threads", info.name, device, params.threads));
  if (!loaded_text.empty()) outputs.event(Stamp{}, "map_load", loaded_text);

  FrameOdometry odometry(lcm.odometry ? lcm.odometry.get() : source.odometry());
  Pipeline pipeline(*engine, config, plan.T_map_cam, &odometry);
  if (map) pipeline.start_lost(o.initial_pose.empty() ? map->info().T_map_cam : plan.T_map_cam);
  Progress progress(frames, o.quiet);
  outputs.show_progress(&progress);
  outputs.watch(&state, archive->get());
  if (config.record.log && outputs.folder()) {
    const std::string config_toml = to_toml(config);
    auto log = LogRecorder::create(config.record, outputs.folder()->dir(),
                                   session_of(source, plan, o, map, config_toml, clock), *lcm.codec);
    if (!log) return fail(log.error(), log.error_kind());
    outputs.log_to(std::move(*log), MessageMaker(config, clock, state, plan.T_map_cam), clock);
  }

  PacedSource paced(source);
  FrameSource& frames_from = o.realtime && !is_camera(o.source) ? paced : source;
  ExecutiveParts parts{frames_from, *engine, pipeline, outputs, state, clock};
  parts.archive = archive->get();
  parts.odometry = &odometry;
  std::optional<MapKeeper> keeper;
  std::optional<Snapshots> snapshots;
  if (const RunFolder* folder = outputs.folder()) {
    if (config.record.map || lcm.commands) {
      keeper.emplace(folder->path(kMapFile), config, *engine, archive->get());
      parts.map_keeper = &*keeper;
      parts.keep_map = [folder](const std::string& file) { return copy_map(*folder, file); };
      parts.make_mesh = [folder](const std::string& file) {
        return mesh_of_map(folder->path(kMapFile), folder->path(file.empty() ? "mesh.ply" : file));
      };
    }
    if (config.record.snapshots > 0 && !live) {
      if (const std::string error = folder->make("snapshots"); !error.empty())
        return fail(error, ErrorKind::failed);
      snapshots.emplace(folder->path("snapshots"), *engine, info, frames, config.record.snapshots);
      parts.observers.push_back(&*snapshots);
    }
  }
  if (observer) {
    observer->begin(source, info);
    parts.observers.push_back(observer);
  }
  parts.codec = lcm.codec.get();
  parts.bus = lcm.bus.get();
  parts.commands = lcm.commands.get();
  parts.service = service;
  parts.sonar = sonar->get();
  parts.stop_requested = stop_requested;
  if (metrics) parts.on_status = [&metrics](const StatusMessage& status) { metrics->show(status); };

  Executive executive(parts, config,
                      {plan.T_map_cam, o.max_frames, live,
                       outputs.folder() && (config.record.masks || config.record.frames)});
  const RunEnd end = executive.run();
  progress.finish();
  const double seconds = progress.seconds();
  outputs.show_progress(nullptr);
  if (snapshots) outputs.tell(snapshots->error());
  outputs.finish(*engine, source, pipeline.counters(),
                 keeper && config.record.map ? &keeper->saver() : nullptr, archive->get(),
                 stop_requested() ? static_cast<double>(config.stop.timeout_s) : -1);
  if (!o.quiet) print_summary(o, outputs, pipeline.counters(), seconds);
  std::fflush(stdout);
  return exit_code_of(end, outputs, pipeline.counters());
}

}  // namespace

int run(const RunOptions& o, FrameObserver* observer) {
  catch_stop_signals();
  const auto plan = plan_run(o);
  if (!plan) return fail(plan.error(), plan.error_kind());
  auto map = open_map(o.map, plan->config);
  if (!map) return fail(map.error(), map.error_kind());
  UtcClock clock;
  auto lcm = open_lcm(o, plan->config, clock, o.realtime || is_camera(o.source));
  if (!lcm) return fail(lcm.error(), lcm.error_kind());
  const std::unique_ptr<ServiceManager> service = systemd_service();
  auto source = open_waiting(o.source, plan->config, service.get(), *lcm, clock);
  if (!source) return stop_requested() ? kExitDone : fail(source.error(), source.error_kind());
  (*source)->skip(o.skip_frames);
  std::optional<LoopedSource> looped;
  if (o.loop_frames > 0) looped.emplace(**source, o.loop_frames);
  return run_with(looped ? *looped : **source, o, *plan, *map, *lcm, clock, service.get(), observer);
}

void add_run(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("run", "track and map a camera or a recording");
  auto options = std::make_shared<RunOptions>();
  declare_run_flags(*command, *options);
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace stillmap
