#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "config/engine_params.hpp"
#include "config/load.hpp"
#include "config/memory_plan.hpp"
#include "drivers/recording/log_source.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/progress.hpp"
#include "firmware-like/commands/run_outputs.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "firmware-like/journal.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_file.hpp"
#include "runtime/core/version.hpp"
#include "runtime/executive/frame_slots.hpp"
#include "runtime/pipeline/pipeline.hpp"

namespace stillmap {
namespace {

/// What was shed then is shed now.
FrameWork work_of(const DecisionMessage& decision) {
  return {decision.integrated, decision.shed == Shed::finest_level ? 1 : 0, decision.sonar_m};
}

/// The configuration of the live run, but for what it wrote and where.
Result<Config> config_of(const LogSource& source, const std::string& log, const std::string& out) {
  auto config =
      parse_config(std::string(source.session().config_toml), log + ": the session's configuration");
  if (!config) return Error{config.error(), ErrorKind::bad_usage};
  config->record.log = config->record.frames = false;
  if (!config->archive.dir.empty())
    config->archive.dir = out.empty() ? std::filesystem::temp_directory_path().string() : out;
  if (const auto good = check(*config); !good) return Error{log + ": " + good.error(), good.error_kind()};
  return *config;
}

/// A live run once more, frame by frame, with what it decided.
class Replay {
 public:
  Replay(LogSource& source, Engine& engine, Pipeline& pipeline, BlockArchive* archive, RunOutputs& outputs)
      : source_(source), engine_(engine), pipeline_(pipeline), archive_(archive), outputs_(outputs) {}

  /// Until the log ends, or a stop is asked for. @return empty, or why the log cannot be read on
  std::string run() {
    FrameSlot slot(source_.info());
    while (!stop_requested()) {
      const Status status = source_.next(slot.frame(), 0);
      if (status == Status::end) return {};
      if (status == Status::unavailable) return source_.error();
      if (status == Status::bad_data)
        pass_over(source_.error());
      else
        repeat(slot.frame());
      outputs_.idle();
    }
    return {};
  }

  TrackingState state() const { return state_; }
  /// False: a frame or an answer of the archive is not what it was; poses from there on may differ.
  bool exact() const { return exact_; }

 private:
  void pass_over(const std::string& why) {
    exact_ = false;
    outputs_.add(Notice::make(Notice::Kind::fault, last_, name_of(Fault::bad_frame), why));
  }

  void repeat(const RgbdFrame& frame) {
    const DecisionMessage& decision = source_.decision();
    if (decision.new_map) start_new_map();
    RunItem item;
    item.has_frame = true;
    item.result = pipeline_.process(frame, work_of(decision));
    if (archive_) repeat_archive(decision);
    item.decision = decision;
    item.counters = pipeline_.counters();
    if (archive_) item.archive = archive_->counters();
    outputs_.add(item, &frame, engine_.mask_image());
    state_ = item.result.state;
    last_ = item.result.stamp;
  }

  void start_new_map() {
    RunItem item;
    item.event.kind = RunEvent::Kind::new_map;
    item.event.stamp = last_;
    item.event.seconds = pipeline_.lost_s();
    outputs_.add(item, nullptr, {});
    pipeline_.start_new_map();
    if (archive_) archive_->forget();
  }

  void repeat_archive(const DecisionMessage& decision) {
    if (exact_ && archive_->repeat_step(engine_, pipeline_.centre_map(), decision.archive_answers)) return;
    exact_ = false;
    archive_->step(engine_, pipeline_.centre_map());
  }

  LogSource& source_;
  Engine& engine_;
  Pipeline& pipeline_;
  BlockArchive* const archive_;
  RunOutputs& outputs_;
  TrackingState state_ = TrackingState::good;
  Stamp last_;
  bool exact_ = true;
};

/// The map that the run went on with, into the engine.
Result<Done> load_map(const SessionMessage& session, const Config& config, Engine& engine,
                      BlockArchive* archive) {
  const std::string path(session.map);
  auto map = MapFile::open(path);
  if (!map) return Error{"the run went on with a map: " + map.error(), map.error_kind()};
  if (const auto fits = map->check_against(config); !fits) return Error{fits.error(), fits.error_kind()};
  if (const auto loaded = map->load(engine, archive); !loaded)
    return Error{loaded.error(), loaded.error_kind()};
  return Done{};
}

/// What keeps the poses from being those of the live run, one line; empty: nothing.
std::string difference(const LogSource& source, const Replay& replay) {
  std::string text = source.damage();
  const auto say = [&](const std::string& what) { text += (text.empty() ? "" : "; ") + what; };
  if (!replay.exact()) say("frames that the run used are missing or damaged, see above");
  if (source.session().version != version())
    say(fmt::format("it was written by stillmap {}", source.session().version));
  return text;
}

int replay(const std::string& log, const std::string& out, bool quiet) {
  catch_stop_signals();
  auto opened = LogSource::open(log, {});
  if (!opened) return fail(opened.error(), opened.error_kind());
  LogSource& source = **opened;
  const auto config = config_of(source, log, out);
  if (!config) return fail(config.error(), config.error_kind());

  const EngineParams params =
      engine_params(*config, source.info().camera, source.info().depth_units_per_m, source.info().depth_bias);
  const MemoryPlan memory = plan_memory(*config, params);
  if (const auto fits = check_budget(memory); !fits) return fail(fits.error(), fits.error_kind());
  const std::unique_ptr<Engine> engine = make_cpu_engine(params);
  if (!engine)
    return fail(fmt::format("the {} MB of the memory plan cannot be had from this machine",
                            memory.total_bytes / 1000000),
                ErrorKind::failed);
  std::unique_ptr<BlockArchive> archive;
  if (!config->archive.dir.empty()) {
    auto made = BlockArchive::open(archive_options(*config));
    if (!made) return fail(made.error(), ErrorKind::failed);
    archive = std::move(*made);
  }
  SourceInfo info = source.info();
  info.camera = params.camera;
  auto made = RunOutputs::create(out, *config, info, -1, Report("cpu", params.threads, memory.total_bytes));
  if (!made) return fail(made.error(), ErrorKind::failed);
  RunOutputs& outputs = **made;
  outputs.watch(nullptr, archive.get());
  outputs.event(Stamp{}, "start",
                fmt::format("replay of {}, cpu engine, {} threads", info.name, params.threads));

  Pipeline pipeline(*engine, *config, source.session().T_map_cam, source.odometry());
  if (!source.session().map.empty()) {
    if (const auto loaded = load_map(source.session(), *config, *engine, archive.get()); !loaded)
      return fail(loaded.error(), loaded.error_kind());
    pipeline.start_lost(source.session().T_map_cam);
  }
  Progress progress(-1, quiet);
  outputs.show_progress(&progress);
  Replay loop(source, *engine, pipeline, archive.get(), outputs);
  const std::string error = loop.run();
  pipeline.finish();
  progress.finish();
  outputs.show_progress(nullptr);
  const std::string why = difference(source, loop);
  if (!why.empty()) {
    outputs.event(Stamp{}, "replay", why);
    say(Priority::warning, "the poses may differ from those of the live run: " + why);
  }
  outputs.finish(*engine, source, pipeline.counters(), nullptr, archive.get(), -1);
  if (!quiet) fmt::print("{} frames in {:.1f} s\n", pipeline.counters().frames, progress.seconds());
  std::fflush(stdout);

  if (!error.empty()) return fail(error, ErrorKind::failed);
  if (outputs.failed()) return fail("not everything could be written, see above", ErrorKind::failed);
  return loop.state() == TrackingState::lost ? kExitLost : kExitDone;
}

struct ReplayOptions {
  std::string log, out;
  bool quiet = false;
};

}  // namespace

void add_replay(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("replay", "a recorded run once more, with what it decided");
  auto options = std::make_shared<ReplayOptions>();
  command
      ->add_option(
          "LOG", options->log,
          "*.lcm of a run with record.frames = true: the first file, those after it follow; or the folder")
      ->required();
  command->add_option("--out", options->out, "folder for trajectory, mesh and report");
  command->add_flag("--quiet", options->quiet, "no progress, no summary");
  command->callback(
      [options, &exit_code] { exit_code = replay(options->log, options->out, options->quiet); });
}

}  // namespace stillmap
