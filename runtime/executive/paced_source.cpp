#include "runtime/executive/paced_source.hpp"

#include <algorithm>
#include <chrono>
#include <thread>

#include "runtime/core/clock.hpp"

namespace stillmap {

Status PacedSource::next(RgbdFrame& frame, int32_t timeout_ms) {
  const int64_t give_up_ns = monotonic_ns() + int64_t{timeout_ms} * 1'000'000;
  if (!waiting_) {
    if (started_) skip_what_is_late(monotonic_ns());
    const Status status = source_.next(frame, timeout_ms);
    if (status != Status::ok) return status;
    if (!started_) {
      started_ = true;
      start_ns_ = monotonic_ns();
      first_ = frame.depth_stamp;
    } else if (const int64_t step_ns = frame.depth_stamp.ns - last_.ns; step_ns > 0) {
      period_ns_ = period_ns_ > 0 ? std::min(period_ns_, step_ns) : step_ns;
    }
    last_ = frame.depth_stamp;
    waiting_ = true;
  }
  const int64_t due = due_ns(frame.depth_stamp);
  if (const int64_t wait_ns = std::min(due, give_up_ns) - monotonic_ns(); wait_ns > 0)
    std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
  if (monotonic_ns() < due) return Status::timeout;
  frame.captured = Stamp{due};
  waiting_ = false;
  return Status::ok;
}

/// The next frame is expected a period after the last one; one that is due less than a period ago is still
/// the newest.
void PacedSource::skip_what_is_late(int64_t now_ns) {
  if (period_ns_ == 0) return;
  const int64_t late_ns = now_ns - (due_ns(last_) + period_ns_);
  if (late_ns < period_ns_) return;
  const auto count = static_cast<uint32_t>(std::min<int64_t>(late_ns / period_ns_, 1000));
  source_.skip(count);
  left_out_ += count;
}

}  // namespace stillmap
