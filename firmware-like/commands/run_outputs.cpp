#include "firmware-like/commands/run_outputs.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <thread>
#include <utility>

#include "config/describe.hpp"
#include "config/engine_params.hpp"
#include "runtime/archive/whole_mesh.hpp"
#include "runtime/core/heap_guard.hpp"
#include "runtime/image/image_file.hpp"
#include "runtime/record/output_file.hpp"
#include "runtime/record/ply_writer.hpp"

namespace stillmap {
namespace {

template <class Writer>
std::string error_of(const Result<Writer>& result) {
  return result ? std::string() : result.error();
}

}  // namespace

RunOutputs::RunOutputs(const Config& config, const SourceInfo& source, int64_t frames, Report report)
    : record_(config.record), config_(config), source_(source), frames_(frames), report_(std::move(report)) {
  const Intrinsics& k = source.camera.k;
  if (record_.snapshots == 0) return;
  raycast_depth_.resize(static_cast<size_t>(k.width) * static_cast<size_t>(k.height));
  raycast_colour_.resize(raycast_depth_.size());
}

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
  if (record_.snapshots > 0) inner.emplace_back("snapshots");
  for (const std::string& name : inner)
    if (std::string error = folder->make(name); !error.empty()) return error;
  if (std::string error = write_whole_file(folder->path("config.toml"), to_toml(config_)); !error.empty())
    return error;
  events_ = std::move(*events);
  files_.emplace(
      Files{std::move(*folder), std::move(*trajectory), std::move(*states), std::move(*timing), {}});
  return {};
}

void RunOutputs::tell(const std::string& error) {
  if (error.empty() || !told_.insert(error).second) return;
  std::fprintf(stderr, "stillmap: %s\n", error.c_str());
  events_.fault(last_stamp_, "record_failed", error);
}

void RunOutputs::add(const RgbdFrame& frame, const FrameResult& result, Engine& engine) {
  const double period_s =
      frames_seen_ == 0 ? 0 : static_cast<double>(result.stamp.ns - last_stamp_.ns) * 1e-9;
  last_stamp_ = result.stamp;
  report_.add(result, period_s);
  note_changes(result);
  if (files_) {
    files_->trajectory.write(result.stamp, result.T_map_cam);
    files_->states.write(result);
    files_->timing.write(result);
    add_truth(frame, result);
    if (result.status != Status::bad_data) add_images(frame, result, engine);
    for (const OutputFile* file :
         {&files_->trajectory.file(), &files_->states.file(), &files_->timing.file()})
      tell(file->error());
    tell(events_.error());
  }
  save_map_on_the_way(result);
  last_ = result;
  ++frames_seen_;
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

void RunOutputs::add_truth(const RgbdFrame& frame, const FrameResult& result) {
  if (!frame.truth_T_world_cam) return;
  const bool has_pose = result.status != Status::bad_data && result.state != TrackingState::lost;
  if (!truth_.anchored() && has_pose) truth_.anchor(result.T_map_cam, *frame.truth_T_world_cam);
  if (!truth_.anchored()) return;
  if (!files_->truth) {
    auto writer = TrajectoryWriter::create(files_->folder.path("truth.txt"));
    if (!writer) return tell(writer.error());
    files_->truth.emplace(std::move(*writer));
  }
  files_->truth->write(result.stamp, truth_.to_map(*frame.truth_T_world_cam));
  tell(files_->truth->file().error());
}

bool RunOutputs::snapshot_due() {
  // The last frame is one of them, the first is not: its map is the frame itself.
  if (frames_ <= 0 || snapshots_taken_ >= record_.snapshots) return false;
  return frames_seen_ + 1 >= (snapshots_taken_ + 1) * frames_ / record_.snapshots;
}

void RunOutputs::add_images(const RgbdFrame& frame, const FrameResult& result, Engine& engine) {
  if (!images_) return;
  const std::string name = file_stamp(result.stamp) + ".png";
  std::string error;
  if (record_.masks)
    error = error_of(write_png_grey(files_->folder.path("masks/" + name), engine.mask_image()));
  if (error.empty() && record_.masks && source_.has_truth_mask)
    error = error_of(write_png_grey(files_->folder.path("masks_truth/" + name), frame.truth_mask));
  if (!error.empty()) {
    tell(error + "; no further images are written");
    images_ = false;
    return;
  }
  if (snapshot_due()) add_snapshot(result, engine);
}

void RunOutputs::add_snapshot(const FrameResult& result, Engine& engine) {
  const Intrinsics& k = source_.camera.k;
  const ImageView<Rgb8> colour{raycast_colour_.data(), k.height, k.width, k.width};
  const std::string path = files_->folder.path("snapshots/" + file_stamp(result.stamp));
  ++snapshots_taken_;
  const ImageView<float> depth_m{raycast_depth_.data(), k.height, k.width, k.width};
  if (engine.raycast(cast<float>(result.T_map_cam), k, depth_m, colour) != Status::ok) return;
  for (const std::string& error : {error_of(write_png(path + "_colour.png", engine.colour_image())),
                                   error_of(write_png_grey(path + "_mask.png", engine.mask_image())),
                                   error_of(write_png(path + "_map.png", colour))}) {
    if (error.empty()) continue;
    tell(error + "; no further images are written");
    images_ = false;
    return;
  }
}

void RunOutputs::bad_frame(Stamp stamp, const std::string& why) {
  events_.fault(stamp, "bad_frame", why);
  constexpr uint64_t kPrinted = 10;
  const uint64_t count = fault_count("bad_frame");
  if (count <= kPrinted) std::fprintf(stderr, "stillmap: frame skipped: %s\n", why.c_str());
  if (count == kPrinted)
    std::fprintf(stderr, "stillmap: further skipped frames go to events.log and report.json only\n");
}

void RunOutputs::rewrite_report(const PipelineCounters& counters) {
  report_.set_counters(counters);
  report_.set_faults(events_.faults());
  if (files_) tell(write_whole_file(files_->folder.path("report.json"), report_.json()));
}

void RunOutputs::write_mesh(Engine& engine, BlockArchive* archive) {
  const auto start = std::chrono::steady_clock::now();
  PlyWriter writer(files_->folder.path("mesh.ply"));
  std::string error;
  if (archive && archive->counters().groups > 0)
    error = extract_whole_mesh(engine, *archive, engine_params(config_, source_.camera, 0),
                               config_.archive.dir, writer);
  else if (const Status status = engine.extract_mesh(writer); status != Status::ok)
    error = to_string(status);
  if (!writer.close()) return tell(writer.error());
  if (!error.empty()) tell(files_->folder.path("mesh.ply") + ": the mesh could not be extracted: " + error);
  mesh_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  mesh_triangles_ = writer.triangle_count();
  events_.info(last_stamp_, "mesh",
               fmt::format("{} vertices, {} triangles in {:.2f} s", writer.vertex_count(), mesh_triangles_,
                           mesh_seconds_));
}

void RunOutputs::note_archive(const BlockArchive& archive) {
  note_archive_trouble(archive);
  const ArchiveCounters& c = archive.counters();
  events_.info(last_stamp_, "archive",
               fmt::format("{} groups of blocks stored, {} brought back, {} MB in {} files now", c.stored,
                           c.restored, c.bytes / 1000000, c.groups));
}

void RunOutputs::note_archive_trouble(const BlockArchive& archive) {
  const ArchiveCounters& c = archive.counters();
  // Each time there are twice as many: an archive may be full for weeks.
  if (c.refused > 2 * archive_said_.refused) {
    archive_said_.refused = c.refused;
    events_.fault(last_stamp_, "archive_full",
                  fmt::format("{} groups could not be stored so far; raise archive.max_bytes", c.refused));
  }
  if (c.failed > 2 * archive_said_.failed) {
    archive_said_.failed = c.failed;
    events_.fault(last_stamp_, "archive_failed",
                  fmt::format("{} so far, the last one: {}", c.failed, archive.last_error()));
  }
}

void RunOutputs::new_map(Stamp stamp, double lost_s) {
  std::string kept;
  if (map_bytes_ > 0 && lost_maps_ < record_.keep_previous) {
    const std::string name = fmt::format("map_lost-{}.smap", ++lost_maps_);
    std::error_code error;
    std::filesystem::rename(map_saver_->path(), files_->folder.path(name), error);
    if (error) tell(fmt::format("{}: {}", files_->folder.path(name), error.message()));
    kept = error ? "" : "; the old one is " + name;
    map_bytes_ = 0;
  }
  truth_ = {};
  events_.fault(
      stamp, "new_map",
      fmt::format("lost for {:.1f} s: a new map begins where the camera was seen last{}", lost_s, kept));
}

void RunOutputs::prepare_map(const Engine& engine, const BlockArchive* archive) {
  if (record_.map && files_)
    map_saver_ = std::make_unique<MapSaver>(files_->folder.path("map.smap"), engine, archive);
}

void RunOutputs::save_map_on_the_way(const FrameResult& result) {
  if (!map_saver_) return;
  const auto period_ns = static_cast<int64_t>(static_cast<double>(record_.map_every_s) * 1e9);
  if (!map_save_due_) map_save_due_ = Stamp{result.stamp.ns + period_ns};
  {
    const heap_guard::Scope armed;  // live, these run in the real-time loop
    if (map_save_is_due(result) && map_saver_->begin(MapInfo::of(config_, result.T_map_cam, result.stamp))) {
      map_saving_ = true;
      lost_map_wanted_ = false;
      map_save_due_->ns = result.stamp.ns + period_ns;
    }
    map_saver_->step();
  }
  note_map_save();
}

/// Now and then, and when the camera was lost: the map may be given up soon.
bool RunOutputs::map_save_is_due(const FrameResult& result) {
  const bool lost = result.state == TrackingState::lost;
  if (!lost) lost_map_wanted_ = false;
  if (lost && last_.state != TrackingState::lost) lost_map_wanted_ = config_.lost.new_map_after_s > 0;
  return lost_map_wanted_ || (!lost && record_.map_every_s > 0 && result.stamp >= *map_save_due_);
}

/// How far it is, once a second; how it ended.
void RunOutputs::note_map_save() {
  if (!map_saving_) return;
  const SaveProgress progress = map_saver_->progress();
  const auto now = std::chrono::steady_clock::now();
  if (progress.saving) {
    if (now < map_progress_due_) return;
    map_progress_due_ = now + std::chrono::seconds(1);
    return events_.info(
        last_stamp_, "map_save",
        fmt::format("{} of {} groups of blocks copied", progress.groups_done, progress.groups));
  }
  map_saving_ = false;
  const SaveResult& result = map_saver_->result();
  tell(result.error);
  if (!result.error.empty()) return;
  map_bytes_ = result.bytes;
  map_seconds_ = result.seconds;
  events_.info(last_stamp_, "map_save",
               fmt::format("{}: {} groups of blocks, {:.1f} MB in {:.2f} s", map_saver_->path(),
                           progress.groups, static_cast<double>(result.bytes) * 1e-6, result.seconds));
}

/// A save that is on its way is of an earlier map: it is ended first.
void RunOutputs::save_map_at_end() {
  const auto end_save = [&] {
    for (; map_saver_->progress().saving; note_map_save())
      if (!map_saver_->step()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    note_map_save();
  };
  end_save();
  map_saving_ = map_saver_->begin(MapInfo::of(config_, last_.T_map_cam, last_.stamp));
  end_save();
}

void RunOutputs::finish(Engine& engine, const FrameSource& source, const PipelineCounters& counters,
                        BlockArchive* archive) {
  report_.set_map(engine.map_health());
  if (archive) note_archive(*archive);
  if (files_) {
    if (record_.mesh) write_mesh(engine, archive);
    if (map_saver_ && frames_seen_ > 0) save_map_at_end();
    if (const auto cloud = source.truth_cloud(); !cloud.empty() && truth_.anchored())
      tell(write_point_cloud(files_->folder.path("truth_cloud.ply"), in_map_frame(truth_, cloud)));
  }
  events_.info(last_stamp_, "stop",
               fmt::format("{} frames; at most {} blocks with voxels in one view", counters.frames,
                           counters.most_visible_blocks));
  rewrite_report(counters);
  if (!files_) return;
  for (OutputFile* file : {&files_->trajectory.file(), &files_->states.file(), &files_->timing.file()})
    if (!file->close()) tell(file->error());
  if (files_->truth && !files_->truth->file().close()) tell(files_->truth->file().error());
  if (!events_.close()) tell(events_.error());
}

uint64_t RunOutputs::fault_count(const std::string& name) const {
  const auto it = events_.faults().find(name);
  return it == events_.faults().end() ? 0 : it->second;
}

}  // namespace stillmap
