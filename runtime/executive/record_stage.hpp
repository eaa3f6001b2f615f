#pragma once

#include <atomic>

#include "runtime/executive/counters.hpp"
#include "runtime/executive/frame_slots.hpp"
#include "runtime/executive/range_stage.hpp"
#include "runtime/executive/run_item.hpp"
#include "runtime/ports/run_recorder.hpp"

namespace stillmap {

/// Gives what comes from the frame loop and the capture to whoever records it, and the slots back.
/// @thread run: record
class RecordStage {
 public:
  /// All outlive this.
  RecordStage(RunQueue& queue, NoticeQueue& from_capture, NoticeQueue& from_supervisor, RangeQueues& ranges,
              FrameSlots& slots, RunState& state, RunRecorder& recorder)
      : queue_(queue),
        from_capture_(from_capture),
        from_supervisor_(from_supervisor),
        ranges_(ranges),
        slots_(slots),
        state_(state),
        recorder_(recorder) {}

  /// Until `finish` and the queues are empty.
  void run();
  void finish() { finish_.store(true, std::memory_order_release); }

 private:
  void add_notices();
  void add_ranges();

  RunQueue& queue_;
  NoticeQueue& from_capture_;
  NoticeQueue& from_supervisor_;
  RangeQueues& ranges_;
  FrameSlots& slots_;
  RunState& state_;
  RunRecorder& recorder_;
  std::atomic<bool> finish_{false};
};

}  // namespace stillmap
