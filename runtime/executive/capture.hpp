#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "runtime/core/bounded_queue.hpp"
#include "runtime/executive/counters.hpp"
#include "runtime/executive/frame_slots.hpp"
#include "runtime/executive/run_item.hpp"

namespace stillmap {

struct CaptureLimits {
  uint32_t max_frames = 0;  ///< to be read; 0: no limit
  // Of cameras, SourceConfig.
  double gone_s = 5;
  double reopen_s = 0.5;
  double reopen_max_s = 10;
};

/// Reads a source until it ends and hands over each frame; where nobody takes them, the newest stays. Waits
/// for a free slot before it reads: with one slot, reading and working alternate and no frame is lost.
/// A camera that is gone is opened again, and again, until it is back or a stop is asked for.
/// @thread run: capture; the others: any
class Capture {
 public:
  Capture(FrameSource& source, FrameSlots& slots, FrameMailbox& mailbox, RunState& state,
          CaptureLimits limits);

  /// Until the source ends, the limit is reached or `state.stop`.
  void run();

  /// The rest of what the source does for a frame that was handed over.  @thread who takes the frames
  void finish(RgbdFrame& frame) const { source_.finish(frame); }

  /// The last frame was handed over.
  bool ended() const { return ended_.load(std::memory_order_acquire); }
  /// What ended it; empty: it came to its end, or was told to stop. After `ended`.
  const std::string& error() const { return error_; }
  /// Why frames were passed over.
  NoticeQueue& notices() { return notices_; }

 private:
  bool deliver(uint32_t slot);
  void count_dropped(uint32_t frames);
  void pass_over(const std::string& why);
  bool gone(Status status) const;
  void wait_for_camera();
  bool pause(double seconds);
  void say(Notice::Kind kind, const std::string& text);
  bool jumps_back(const RgbdFrame& frame) const { return delivered_ > 0 && frame.depth_stamp <= last_; }

  FrameSource& source_;
  FrameSlots& slots_;
  FrameMailbox& mailbox_;
  RunState& state_;
  const CaptureLimits limits_;
  NoticeQueue notices_;
  Stamp last_;
  uint32_t delivered_ = 0;
  uint32_t left_out_ = 0;  ///< by the source, as counted
  std::string error_;
  std::atomic<bool> ended_{false};
};

}  // namespace stillmap
