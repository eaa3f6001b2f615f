#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "kernels/engine.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_saver.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/ports/frame_source.hpp"
#include "runtime/record/events_log.hpp"
#include "runtime/record/report.hpp"
#include "runtime/record/run_folder.hpp"
#include "runtime/record/states_writer.hpp"
#include "runtime/record/trajectory_writer.hpp"
#include "runtime/record/truth_frame.hpp"

namespace stillmap {

/// What a run leaves in its folder. A file that cannot be written is reported once, the others go on, and
/// `failed()` says so at the end. Without a folder only counters are kept. @thread one
class RunOutputs {
 public:
  /// Makes the folder, moves an earlier run away and opens the streams.
  /// @param dir "": no folder  @param source with the camera that the engine uses  @param frames expected,
  /// -1: unknown
  static Result<std::unique_ptr<RunOutputs>> create(const std::string& dir, const Config& config,
                                                    const SourceInfo& source, int64_t frames, Report report);

  /// Where record.map asks for it: takes the memory for saving the map. @param engine outlives this
  /// @thread boot
  void prepare_map(const Engine& engine, const BlockArchive* archive);

  /// After each processed frame, while the engine still holds it.
  void add(const RgbdFrame& frame, const FrameResult& result, Engine& engine);
  /// Says at once what the archive refuses or loses. After each frame.
  void note_archive_trouble(const BlockArchive& archive);
  /// While the camera is lost: what was mapped is in map.smap, or is not asked for.
  bool map_may_go() const { return !map_saver_ || (!lost_map_wanted_ && !map_saving_); }
  /// The map is given up. Its file, where there is one, stays as map_lost-N.smap (record.keep_previous of
  /// them).
  void new_map(Stamp stamp, double lost_s);
  /// A frame that was passed over.
  void bad_frame(Stamp stamp, const std::string& why);
  void event(Stamp stamp, const char* name, const std::string& text) { events_.info(stamp, name, text); }
  void fault(Stamp stamp, const char* name, const std::string& text) { events_.fault(stamp, name, text); }
  void rewrite_report(const PipelineCounters& counters);
  /// Mesh, true cloud, report; closes the streams.
  /// @param archive null: there is none
  void finish(Engine& engine, const FrameSource& source, const PipelineCounters& counters,
              BlockArchive* archive);

  bool failed() const { return !told_.empty(); }
  uint64_t fault_count(const std::string& name) const;
  const Report& report() const { return report_; }
  double mesh_seconds() const { return mesh_seconds_; }
  uint64_t mesh_triangles() const { return mesh_triangles_; }
  /// Of map.smap; 0: it was not asked for, or could not be written.
  uint64_t map_bytes() const { return map_bytes_; }
  double map_seconds() const { return map_seconds_; }

 private:
  struct Files {
    RunFolder folder;
    TrajectoryWriter trajectory;
    StatesWriter states;
    TimingWriter timing;
    std::optional<TrajectoryWriter> truth;
  };

  RunOutputs(const Config& config, const SourceInfo& source, int64_t frames, Report report);
  std::string open(const std::string& dir);
  void tell(const std::string& error);
  void note_changes(const FrameResult& result);
  void add_truth(const RgbdFrame& frame, const FrameResult& result);
  void add_images(const RgbdFrame& frame, const FrameResult& result, Engine& engine);
  void add_snapshot(const FrameResult& result, Engine& engine);
  bool snapshot_due();
  void write_mesh(Engine& engine, BlockArchive* archive);
  void note_archive(const BlockArchive& archive);
  bool map_save_is_due(const FrameResult& result);
  void save_map_on_the_way(const FrameResult& result);
  void note_map_save();
  void save_map_at_end();

  RecordConfig record_;
  Config config_;
  SourceInfo source_;
  int64_t frames_;
  Report report_;
  EventsLog events_;
  std::optional<Files> files_;
  TruthFrame truth_;
  std::set<std::string> told_;
  std::vector<float> raycast_depth_;
  std::vector<Rgb8> raycast_colour_;
  bool images_ = true;
  int64_t frames_seen_ = 0;
  int32_t snapshots_taken_ = 0;
  Stamp last_stamp_;
  FrameResult last_;
  double mesh_seconds_ = 0;
  uint64_t mesh_triangles_ = 0;
  std::unique_ptr<MapSaver> map_saver_;  ///< null: no map is saved
  std::optional<Stamp> map_save_due_;
  std::chrono::steady_clock::time_point map_progress_due_;
  bool lost_map_wanted_ = false;  ///< the camera was lost: what there is is to be saved
  int32_t lost_maps_ = 0;
  ArchiveCounters archive_said_;  ///< in the last event
  bool map_saving_ = false;       ///< a save began whose end was not noted yet
  uint64_t map_bytes_ = 0;
  double map_seconds_ = 0;
};

}  // namespace stillmap
