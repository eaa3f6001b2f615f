#pragma once

#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// A recording played at the pace of its stamps (--realtime): a frame is there when its time has come, as if
/// a camera delivered it. Frames whose time has passed by more than a period are skipped without decoding
/// them, as a camera would have dropped them.
/// @thread as FrameSource
class PacedSource final : public FrameSource {
 public:
  /// @param source outlives this
  explicit PacedSource(FrameSource& source) : source_(source) {}

  const SourceInfo& info() const override { return source_.info(); }
  /// Decodes ahead; while a frame waits for its time every call has to pass the same memory.
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  std::vector<Vec3> truth_cloud() const override { return source_.truth_cloud(); }
  OdometryPort* odometry() override { return source_.odometry(); }
  void skip(uint32_t count) override { source_.skip(count); }
  const std::string& error() const override { return source_.error(); }

  uint32_t left_out() const override { return left_out_; }

 private:
  int64_t due_ns(Stamp stamp) const { return start_ns_ + (stamp.ns - first_.ns); }
  void skip_what_is_late(int64_t now_ns);

  FrameSource& source_;
  bool started_ = false, waiting_ = false;
  int64_t start_ns_ = 0;  ///< CLOCK_MONOTONIC, of the first frame
  Stamp first_, last_;
  int64_t period_ns_ = 0;  ///< shortest between two frames; 0: not known yet
  uint32_t left_out_ = 0;
};

}  // namespace stillmap
