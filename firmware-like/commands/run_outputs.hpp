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
#include "firmware-like/commands/progress.hpp"
#include "kernels/engine.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_saver.hpp"
#include "runtime/executive/counters.hpp"
#include "runtime/executive/message_maker.hpp"
#include "runtime/executive/run_item.hpp"
#include "runtime/ports/frame_source.hpp"
#include "runtime/ports/run_recorder.hpp"
#include "runtime/record/events_log.hpp"
#include "runtime/record/log_recorder.hpp"
#include "runtime/record/report.hpp"
#include "runtime/record/run_folder.hpp"
#include "runtime/record/states_writer.hpp"
#include "runtime/record/trajectory_writer.hpp"
#include "runtime/record/truth_frame.hpp"

namespace stillmap {

/// What a run leaves in its folder. A file that cannot be written is reported once, the others go on, and
/// `failed()` says so at the end. Without a folder only counters are kept.
/// @thread record while the threads run, the supervisor's before and after
class RunOutputs final : public RunRecorder {
 public:
  /// Makes the folder, moves an earlier run away and opens the streams.
  /// @param dir "": no folder  @param source with the camera that the engine uses  @param frames expected,
  /// -1: unknown
  static Result<std::unique_ptr<RunOutputs>> create(const std::string& dir, const Config& config,
                                                    const SourceInfo& source, int64_t frames, Report report);

  void show_progress(Progress* progress) { progress_ = progress; }
  /// Everything goes into this event log as well. @param maker of its own: it goes from frame to frame
  /// @param clock outlives this
  void log_to(std::unique_ptr<LogRecorder> log, MessageMaker maker, const UtcClock& clock);
  /// The report's faults and counters come from there. @param state outlives this
  void watch(RunState* state, const BlockArchive* archive) {
    state_ = state;
    archive_ = archive;
  }

  void add(const RunItem& item, const RgbdFrame* frame, ImageView<const uint8_t> mask) override;
  void add(const Notice& notice) override;
  void add(const RangeReading& reading) override;
  /// Rewrites the report once a minute.
  void idle() override;
  void event(Stamp stamp, const char* name, const std::string& text) { events_.info(stamp, name, text); }
  void fault(Stamp stamp, const char* name, const std::string& text) { events_.fault(stamp, name, text); }
  /// Closes the streams; then mesh and map (within the time, where it is limited), true cloud, report.
  /// @param saver null: the map is not saved  @param archive null: there is none  @param timeout_s 0 or more:
  /// a stop was asked for; negative: no limit
  void finish(Engine& engine, const FrameSource& source, const PipelineCounters& counters, MapSaver* saver,
              BlockArchive* archive, double timeout_s);

  bool failed() const { return !told_.empty(); }
  uint64_t fault_count(const std::string& name) const;
  const Report& report() const { return report_; }
  /// The folder, where there is one. It makes what is asked of it inside.
  const RunFolder* folder() const { return files_ ? &files_->folder : nullptr; }
  /// Reports an error of somebody else's file, once.
  void tell(const std::string& error);
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

  static constexpr std::chrono::seconds kReportPeriod{60};

  RunOutputs(const Config& config, const SourceInfo& source, int64_t frames, Report report);
  std::string open(const std::string& dir);
  void add_frame(const RunItem& item, const RgbdFrame* frame, ImageView<const uint8_t> mask);
  void add_event(const RunEvent& event);
  void bad_frame(Stamp stamp, const std::string& why);
  void add_to_log(const RunItem& item, const RgbdFrame* frame);
  void note_log(Status status);
  void pass_on_event(bool fault, std::string_view name, std::string_view text);
  void note_changes(const FrameResult& result);
  void add_truth(const RunItem& item);
  void add_masks(const RgbdFrame& frame, const FrameResult& result, ImageView<const uint8_t> mask);
  void note_new_map(Stamp stamp, const std::string& why);
  void note_saved_map(uint64_t groups, uint64_t bytes, double seconds);
  void note_archive(const BlockArchive& archive);
  void note_archive_trouble(const ArchiveCounters& counters);
  void close_streams();
  void write_mesh(Engine& engine, BlockArchive* archive, double deadline_s);
  void save_map(MapSaver& saver, double deadline_s);
  void rewrite_report();
  std::string map_path() const { return files_->folder.path("map.smap"); }

  RecordConfig record_;
  Config config_;
  SourceInfo source_;
  int64_t frames_;
  Report report_;
  EventsLog events_;
  std::optional<Files> files_;
  TruthFrame truth_;
  std::set<std::string> told_;
  bool images_ = true;
  int64_t frames_seen_ = 0;
  Stamp last_stamp_;
  FrameResult last_;
  double mesh_seconds_ = 0;
  uint64_t mesh_triangles_ = 0;
  Progress* progress_ = nullptr;
  RunState* state_ = nullptr;
  std::unique_ptr<LogRecorder> log_;  ///< null: record.log is off
  bool log_fails_ = false;
  std::optional<MessageMaker> maker_;
  const UtcClock* clock_ = nullptr;
  const BlockArchive* archive_ = nullptr;
  PipelineCounters counters_;
  std::chrono::steady_clock::time_point report_due_ = std::chrono::steady_clock::now() + kReportPeriod;
  int32_t lost_maps_ = 0;
  ArchiveCounters archive_said_;  ///< in the last event
  uint64_t map_bytes_ = 0;
  double map_seconds_ = 0;
};

}  // namespace stillmap
