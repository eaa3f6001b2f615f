#include "firmware-like/commands/run_loop.hpp"

#include <fmt/format.h>

#include <chrono>

#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/core/heap_guard.hpp"
#include "runtime/record/trajectory_writer.hpp"

namespace stillmap {
namespace {

constexpr int32_t kWaitMs = 100;  ///< how long a stop signal may go unseen while no frame comes
constexpr std::chrono::seconds kReportPeriod{60};

FrameResult process_guarded(Pipeline& pipeline, const RgbdFrame& frame, Engine& engine,
                            BlockArchive* archive) {
  const heap_guard::Scope armed;
  const FrameResult result = pipeline.process(frame);
  if (archive) archive->step(engine, pipeline.centre_map());
  return result;
}

/// Stamps have to rise: what comes after the pipeline (files, filters) relies on it.
bool jumps_back(const RgbdFrame& frame, uint32_t frames_done, Stamp last) {
  return frames_done > 0 && frame.depth_stamp <= last;
}

std::string jump_text(const RgbdFrame& frame, Stamp last) {
  return fmt::format("frame {}: stamp {} is not later than the one before it, {}", frame.sequence,
                     file_stamp(frame.depth_stamp), file_stamp(last));
}

/// A camera that was not found again for long: what it sees now is all there is to go by. Waits until the
/// old map is in its file, where one is asked for.
void give_up_map(const FrameResult& result, Pipeline& pipeline, RunOutputs& outputs, BlockArchive* archive) {
  if (!outputs.map_may_go()) return;
  outputs.new_map(result.stamp, pipeline.lost_s());
  const heap_guard::Scope armed;
  pipeline.start_new_map();
  if (archive) archive->forget();
}

}  // namespace

LoopEnd run_loop(FrameSource& source, Engine& engine, Pipeline& pipeline, RunOutputs& outputs,
                 Progress& progress, RgbdFrame& slot, const LoopLimits& limits, FrameObserver* observer,
                 BlockArchive* archive) {
  LoopEnd end;
  Stamp last;
  auto report_due = std::chrono::steady_clock::now() + kReportPeriod;
  for (uint32_t read = 0, done = 0;
       (limits.max_frames == 0 || read < limits.max_frames) && !stop_requested();) {
    const Status status = source.next(slot, kWaitMs);
    if (status == Status::timeout) continue;
    if (status == Status::end) break;
    if (status != Status::ok && status != Status::bad_data) {
      end.error = source.error();
      break;
    }
    ++read;
    if (status == Status::bad_data || jumps_back(slot, done, last)) {
      progress.finish();
      outputs.bad_frame(last, status == Status::bad_data ? source.error() : jump_text(slot, last));
      continue;
    }
    const FrameResult result = process_guarded(pipeline, slot, engine, archive);
    last = result.stamp;
    end.state = result.state;
    outputs.add(slot, result, engine);
    if (observer) observer->see(slot, result, engine);
    if (archive) outputs.note_archive_trouble(*archive);
    progress.show(result, ++done);
    if (limits.new_map_after_s > 0 && pipeline.lost_s() >= limits.new_map_after_s)
      give_up_map(result, pipeline, outputs, archive);
    if (std::chrono::steady_clock::now() < report_due) continue;
    outputs.rewrite_report(pipeline.counters());
    report_due += kReportPeriod;
  }
  progress.finish();
  return end;
}

}  // namespace stillmap
