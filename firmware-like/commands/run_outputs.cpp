#include "firmware-like/commands/run_outputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <system_error>
#include <thread>
#include <utility>

#include "config/describe.hpp"
#include "config/engine_params.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "firmware-like/journal.hpp"
#include "runtime/archive/whole_mesh.hpp"
#include "runtime/core/clock.hpp"
#include "runtime/core/heap_guard.hpp"
#include "runtime/image/image_file.hpp"
#include "runtime/record/output_file.hpp"
#include "runtime/record/ply_writer.hpp"

namespace stillmap {
namespace {

double seconds_now() {
  return static_cast<double>(monotonic_ns()) * 1e-9;
}

template <class Writer>
std::string error_of(const Result<Writer>& result) {
  return result ? std::string() : result.error();
}

}  // namespace

RunOutputs::RunOutputs(const Config& config, const SourceInfo& source, int64_t frames, Report report)
    : record_(config.record), config_(config), source_(source), frames_(frames), report_(std::move(report)) {}

Result<std::unique_ptr<RunOutputs>> RunOutputs::create(const std::string& dir, const Config& config,
                                                       const SourceInfo& source, int64_t frames,
                                                       Report report) {
  std::unique_ptr<RunOutputs> outputs(new RunOutputs(config, source, frames, std::move(report)));
  if (dir.empty()) return outputs;
  if (const std::string error = outputs->open(dir); !error.empty()) return Error{error};
  return outputs;
}

std::string RunOutputs::open(const std::string& dir) {
  auto folder = RunFolder::open(dir, record_.keep_previous);
  if (!folder) return folder.error();
  auto trajectory = TrajectoryWriter::create(folder->path("trajectory.txt"));
  auto states = StatesWriter::create(folder->path("states.csv"));
  auto timing = TimingWriter::create(folder->path("timing.csv"));
  auto events = EventsLog::create(folder->path("events.log"));
  for (const std::string& error :
       {error_of(trajectory), error_of(states), error_of(timing), error_of(events)})
    if (!error.empty()) return error;
  std::vector<std::string> inner;
  if (record_.masks) inner.emplace_back("masks");
  if (record_.masks && source_.has_truth_mask) inner.emplace_back("masks_truth");
  for (const std::string& name : inner)
    if (std::string error = folder->make(name); !error.empty()) return error;
  if (std::string error = write_whole_file(folder->path("config.toml"), to_toml(config_)); !error.empty())
    return error;
  const auto most_bytes = static_cast<uint64_t>(record_.stream_bytes);
  trajectory->file().rotate_at(most_bytes, record_.streams_kept);
  states->rotate_at(most_bytes, record_.streams_kept);
  timing->rotate_at(most_bytes, record_.streams_kept);
  events_ = std::move(*events);
  events_.set_listener(
      [this](bool fault, std::string_view name, std::string_view text) { pass_on_event(fault, name, text); });
  files_.emplace(
      Files{std::move(*folder), std::move(*trajectory), std::move(*states), std::move(*timing), {}});
  return {};
}

void RunOutputs::tell(const std::string& error) {
  if (error.empty() || !told_.insert(error).second) return;
  if (!journal_reads()) say(Priority::error, error);
  events_.fault(last_stamp_, "record_failed", error);
  if (state_) state_->faults.raise(Fault::record_failed, monotonic_ns());
}

void RunOutputs::add(const RunItem& item, const RgbdFrame* frame, ImageView<const uint8_t> mask) {
  if (item.has_frame) add_frame(item, frame, mask);
  if (item.event.kind != RunEvent::Kind::none) add_event(item.event);
}

void RunOutputs::add(const Notice& notice) {
  if (progress_) progress_->finish();
  if (notice.name == name_of(Fault::bad_frame)) return bad_frame(notice.stamp, notice.text);
  switch (notice.kind) {
    case Notice::Kind::info:
      return events_.info(notice.stamp, notice.name, notice.text);
    case Notice::Kind::warning:
      return events_.warning(notice.stamp, notice.name, notice.text);
    case Notice::Kind::fault:
      return events_.fault(notice.stamp, notice.name, notice.text);
  }
}

void RunOutputs::add(const RangeReading& reading) {
  if (log_) note_log(log_->write(maker_->range(reading)));
}

void RunOutputs::log_to(std::unique_ptr<LogRecorder> log, MessageMaker maker, const UtcClock& clock) {
  log_ = std::move(log);
  maker_.emplace(std::move(maker));
  clock_ = &clock;
}

/// What events.log has goes to the journal and into the event log as well.
void RunOutputs::pass_on_event(bool fault, std::string_view name, std::string_view text) {
  if (journal_reads()) say(fault ? Priority::warning : Priority::info, fmt::format("{}: {}", name, text));
  if (!log_) return;
  EventMessage message;
  message.utime.us = clock_->to_utc_us(monotonic_ns());
  message.fault = fault;
  message.name = name.substr(0, kEventNameBytes);
  message.text = text.substr(0, kEventTextBytes);
  note_log(log_->write(message));
}

void RunOutputs::add_to_log(const RunItem& item, const RgbdFrame* frame) {
  const PublishItem published{item.result, true, item.pose_epoch, item.map_id};
  if (item.result.state != TrackingState::lost) note_log(log_->write(maker_->pose(published)));
  note_log(log_->write(maker_->status(published, 0)));
  DecisionMessage decision = item.decision;
  decision.utime.us = clock_->to_utc_us(item.result.captured.ns);
  note_log(log_->write(decision, frame));
}

/// What keeps an event from the log is a fault that holds until one gets there again.
void RunOutputs::note_log(Status status) {
  if (!state_) return;
  const int64_t now_ns = monotonic_ns();
  const bool fails = status != Status::ok;
  if (fails == log_fails_) return;
  log_fails_ = fails;
  if (!fails) {
    state_->faults.clear(Fault::log_full);
    state_->faults.clear(Fault::record_failed);
    return;
  }
  const Fault fault = status == Status::capacity_exhausted ? Fault::log_full : Fault::record_failed;
  state_->faults.hold(fault, now_ns);
  if (!journal_reads()) say(Priority::error, log_->error());
  events_.fault(last_stamp_, name_of(fault), log_->error());
}

void RunOutputs::idle() {
  if (log_) {
    if (rotation_requested()) log_->rotate();
    if (const Status status = log_->step(); status != Status::ok) note_log(status);
  }
  if (std::chrono::steady_clock::now() < report_due_) return;
  rewrite_report();
  report_due_ += kReportPeriod;
}

void RunOutputs::add_frame(const RunItem& item, const RgbdFrame* frame, ImageView<const uint8_t> mask) {
  const FrameResult& result = item.result;
  const double period_s =
      frames_seen_ == 0 ? 0 : static_cast<double>(result.stamp.ns - last_stamp_.ns) * 1e-9;
  last_stamp_ = result.stamp;
  counters_ = item.counters;
  report_.add(result, period_s);
  report_.set_map(result.map);
  note_changes(result);
  if (files_) {
    files_->trajectory.write(result.stamp, result.T_map_cam);
    files_->states.write(result);
    files_->timing.write(result);
    add_truth(item);
    if (frame && result.status != Status::bad_data) add_masks(*frame, result, mask);
    for (const OutputFile* file :
         {&files_->trajectory.file(), &files_->states.file(), &files_->timing.file()})
      tell(file->error());
    tell(events_.error());
  }
  if (log_) add_to_log(item, frame);
  if (archive_) note_archive_trouble(item.archive);
  last_ = result;
  ++frames_seen_;
  if (progress_) progress_->show(result, static_cast<uint32_t>(frames_seen_));
}

void RunOutputs::add_event(const RunEvent& event) {
  switch (event.kind) {
    case RunEvent::Kind::none:
      return;
    case RunEvent::Kind::new_map:
      return note_new_map(event.stamp, fmt::format("lost for {:.1f} s", event.seconds));
    case RunEvent::Kind::reset:
      return note_new_map(event.stamp, "reset by command");
    case RunEvent::Kind::map_save_progress:
      return events_.info(event.stamp, "map_save",
                          fmt::format("{} of {} groups of blocks copied", event.done, event.of));
    case RunEvent::Kind::map_saved:
      return note_saved_map(event.of, event.done, event.seconds);
    case RunEvent::Kind::map_save_failed:
      return tell(event.text);
  }
}

void RunOutputs::note_changes(const FrameResult& r) {
  if (r.status == Status::bad_data)
    events_.fault(
        r.stamp, "bad_frame",
        fmt::format("frame {}: fewer valid depth pixels than depth.min_valid_pixels; not used", r.sequence));
  if (r.state == TrackingState::lost && last_.state != TrackingState::lost)
    events_.fault(r.stamp, "tracking_lost",
                  fmt::format("frame {}: inlier ratio {:.2f}", r.sequence, r.inlier_ratio));
  if (r.state != TrackingState::lost && r.state != last_.state)
    events_.info(r.stamp, "tracking", fmt::format("frame {}: {}", r.sequence, to_string(r.state)));
  const auto given_up = [](const MapHealth& m) { return m.dropped_blocks + m.table_full + m.pool_empty; };
  if (given_up(r.map) > given_up(last_.map))
    events_.fault(r.stamp, "map_full",
                  fmt::format("{} far blocks dropped, {} insertions refused so far; raise map.pool_blocks",
                              r.map.dropped_blocks, r.map.table_full + r.map.pool_empty));
}

void RunOutputs::add_truth(const RunItem& item) {
  if (!item.truth_T_world_cam) return;
  const FrameResult& result = item.result;
  const bool has_pose = result.status != Status::bad_data && result.state != TrackingState::lost;
  if (!truth_.anchored() && has_pose) truth_.anchor(result.T_map_cam, *item.truth_T_world_cam);
  if (!truth_.anchored()) return;
  if (!files_->truth) {
    auto writer = TrajectoryWriter::create(files_->folder.path("truth.txt"));
    if (!writer) return tell(writer.error());
    files_->truth.emplace(std::move(*writer));
    files_->truth->file().rotate_at(static_cast<uint64_t>(record_.stream_bytes), record_.streams_kept);
  }
  files_->truth->write(result.stamp, truth_.to_map(*item.truth_T_world_cam));
  tell(files_->truth->file().error());
}

void RunOutputs::add_masks(const RgbdFrame& frame, const FrameResult& result, ImageView<const uint8_t> mask) {
  if (!images_ || !record_.masks) return;
  const std::string name = file_stamp(result.stamp) + ".png";
  std::string error = error_of(write_png_grey(files_->folder.path("masks/" + name), mask));
  if (error.empty() && source_.has_truth_mask)
    error = error_of(write_png_grey(files_->folder.path("masks_truth/" + name), frame.truth_mask));
  if (error.empty()) return;
  tell(error + "; no further images are written");
  images_ = false;
}

void RunOutputs::bad_frame(Stamp stamp, const std::string& why) {
  events_.fault(stamp, "bad_frame", why);
  constexpr uint64_t kPrinted = 10;
  const uint64_t count = fault_count("bad_frame");
  if (journal_reads()) return;
  if (count <= kPrinted) say(Priority::warning, "frame skipped: " + why);
  if (count == kPrinted)
    say(Priority::warning, "further skipped frames go to events.log and report.json only");
}

void RunOutputs::rewrite_report() {
  report_.set_counters(counters_);
  report_.set_heap_allocations(heap_guard::allocations());
  auto faults = events_.faults();
  if (state_) {
    report_.set_dropped(state_->frames_dropped.load(std::memory_order_relaxed));
    for (uint32_t i = 0; i < kFaults; ++i) {
      const auto fault = static_cast<Fault>(i);
      const uint64_t count = state_->faults.entry(fault).count;
      if (count == 0) continue;
      uint64_t& entry = faults[std::string(name_of(fault))];
      entry = std::max(entry, count);
    }
  }
  report_.set_faults(std::move(faults));
  if (files_) tell(write_whole_file(files_->folder.path("report.json"), report_.json()));
}

namespace {

/// Stops an extraction whose time is up.
class TimedSink final : public MeshSink {
 public:
  TimedSink(MeshSink& sink, double deadline_s) : sink_(sink), deadline_s_(deadline_s) {}

  bool begin(uint64_t vertices, uint64_t triangles) override {
    return in_time() && sink_.begin(vertices, triangles);
  }
  bool vertices(View<const Vec3> positions_m, View<const Rgb8> colours) override {
    return in_time() && sink_.vertices(positions_m, colours);
  }
  bool triangles(View<const uint32_t> indices) override { return in_time() && sink_.triangles(indices); }

 private:
  bool in_time() const { return seconds_now() < deadline_s_; }

  MeshSink& sink_;
  const double deadline_s_;
};

}  // namespace

void RunOutputs::write_mesh(Engine& engine, BlockArchive* archive, double deadline_s) {
  const double start_s = seconds_now();
  PlyWriter writer(files_->folder.path("mesh.ply"));
  TimedSink sink(writer, deadline_s);
  std::string error;
  if (archive && archive->counters().groups > 0)
    error = extract_whole_mesh(engine, *archive, engine_params(config_, source_.camera, 0),
                               config_.archive.dir, sink);
  else if (const Status status = engine.extract_mesh(sink); status != Status::ok)
    error = to_string(status);
  const bool in_time = seconds_now() < deadline_s;
  const bool closed = writer.close();
  if (!in_time)
    return events_.warning(last_stamp_, "mesh", "not written: it did not fit into stop.timeout_s");
  if (!closed) return tell(writer.error());
  if (!error.empty()) tell(files_->folder.path("mesh.ply") + ": the mesh could not be extracted: " + error);
  mesh_seconds_ = seconds_now() - start_s;
  mesh_triangles_ = writer.triangle_count();
  events_.info(last_stamp_, "mesh",
               fmt::format("{} vertices, {} triangles in {:.2f} s", writer.vertex_count(), mesh_triangles_,
                           mesh_seconds_));
}

void RunOutputs::note_archive(const BlockArchive& archive) {
  const ArchiveCounters& c = archive.counters();
  note_archive_trouble(c);
  events_.info(last_stamp_, "archive",
               fmt::format("{} groups of blocks stored, {} brought back, {} MB in {} files now", c.stored,
                           c.restored, c.bytes / 1000000, c.groups));
}

void RunOutputs::note_archive_trouble(const ArchiveCounters& c) {
  // Each time there are twice as many: an archive may be full for weeks.
  if (c.refused > 2 * archive_said_.refused) {
    archive_said_.refused = c.refused;
    events_.fault(last_stamp_, "archive_full",
                  fmt::format("{} groups could not be stored so far; raise archive.max_bytes", c.refused));
  }
  if (c.failed > 2 * archive_said_.failed) {
    archive_said_.failed = c.failed;
    events_.fault(last_stamp_, "archive_failed",
                  fmt::format("{} so far, the last one: {}", c.failed, archive_->last_error()));
  }
}

void RunOutputs::note_new_map(Stamp stamp, const std::string& why) {
  std::string kept;
  if (map_bytes_ > 0 && lost_maps_ < record_.keep_previous) {
    const std::string name = fmt::format("map_lost-{}.smap", ++lost_maps_);
    std::error_code error;
    std::filesystem::rename(map_path(), files_->folder.path(name), error);
    if (error) tell(fmt::format("{}: {}", files_->folder.path(name), error.message()));
    kept = error ? "" : "; the old one is " + name;
    map_bytes_ = 0;
  }
  truth_ = {};
  events_.fault(stamp, "new_map",
                fmt::format("{}: a new map begins where the camera was seen last{}", why, kept));
}

void RunOutputs::note_saved_map(uint64_t groups, uint64_t bytes, double seconds) {
  map_bytes_ = bytes;
  map_seconds_ = seconds;
  events_.info(last_stamp_, "map_save",
               fmt::format("{}: {} groups of blocks, {:.1f} MB in {:.2f} s", map_path(), groups,
                           static_cast<double>(bytes) * 1e-6, seconds));
}

/// A save that is on its way is of an earlier map: it is ended first.
void RunOutputs::save_map(MapSaver& saver, double deadline_s) {
  for (const bool last : {false, true}) {
    if (last && !saver.begin(MapInfo::of(config_, last_.T_map_cam, last_.stamp))) return;
    while (saver.progress().saving) {
      if (seconds_now() > deadline_s)
        return events_.warning(last_stamp_, "map_save",
                               "not written: it did not fit into stop.timeout_s; an earlier map.smap stays");
      if (!saver.step()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  const SaveResult& result = saver.result();
  if (!result.error.empty()) return tell(result.error);
  note_saved_map(saver.progress().groups, result.bytes, result.seconds);
}

void RunOutputs::finish(Engine& engine, const FrameSource& source, const PipelineCounters& counters,
                        MapSaver* saver, BlockArchive* archive, double timeout_s) {
  const double deadline_s =
      timeout_s >= 0 ? seconds_now() + timeout_s : std::numeric_limits<double>::infinity();
  counters_ = counters;
  report_.set_map(engine.map_health());
  if (archive) note_archive(*archive);
  if (files_) {
    close_streams();
    if (saver && frames_seen_ > 0) save_map(*saver, deadline_s);
    if (record_.mesh) write_mesh(engine, archive, deadline_s);
    if (const auto cloud = source.truth_cloud(); !cloud.empty() && truth_.anchored())
      tell(write_point_cloud(files_->folder.path("truth_cloud.ply"), in_map_frame(truth_, cloud)));
  }
  events_.info(last_stamp_, "stop",
               fmt::format("{} frames; at most {} blocks with voxels in one view", counters.frames,
                           counters.most_visible_blocks));
  if (counters.not_mapped > 0)
    events_.info(
        last_stamp_, "completion",
        fmt::format("{} frames that waited to be completed were not mapped: the camera was lost, or the map "
                    "given up",
                    counters.not_mapped));
  rewrite_report();
  events_.set_listener({});
  if (log_ && !log_->close()) tell(log_->error());
  if (files_ && !events_.close()) tell(events_.error());
}

void RunOutputs::close_streams() {
  for (OutputFile* file : {&files_->trajectory.file(), &files_->states.file(), &files_->timing.file()})
    if (!file->close()) tell(file->error());
  if (files_->truth && !files_->truth->file().close()) tell(files_->truth->file().error());
}

uint64_t RunOutputs::fault_count(const std::string& name) const {
  const auto it = events_.faults().find(name);
  return it == events_.faults().end() ? 0 : it->second;
}

}  // namespace stillmap
