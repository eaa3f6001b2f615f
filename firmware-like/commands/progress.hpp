#pragma once

#include <chrono>
#include <cstdint>

#include "runtime/pipeline/pipeline.hpp"

namespace stillmap {

/// How far a run is, on stdout: one line rewritten on a terminal, one line a second into a pipe. @thread one
class Progress {
 public:
  /// @param frames expected, -1: unknown
  /// Nothing is shown where systemd's journal reads: a line a second for weeks is none that anybody looks
  /// for.
  Progress(int64_t frames, bool quiet);

  void show(const FrameResult& result, uint32_t frames_done);
  /// Ends the rewritten line.
  void finish();
  double seconds() const;

 private:
  using Clock = std::chrono::steady_clock;

  int64_t frames_;
  bool quiet_, terminal_, line_open_ = false;
  Clock::time_point start_ = Clock::now(), last_ = start_;
  uint32_t frames_at_last_ = 0;
};

}  // namespace stillmap
