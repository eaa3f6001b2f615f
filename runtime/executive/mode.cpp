#include "runtime/executive/mode.hpp"

#include <algorithm>

namespace stillmap {

FaultAction action_of(Fault fault) {
  switch (fault) {
    case Fault::tracking_lost:
    case Fault::camera_stalled:
    case Fault::camera_gone:
    case Fault::device_failed:
      return FaultAction::lose;
    case Fault::work_shed:
    case Fault::thread_stalled:
    case Fault::bus_unavailable:
    case Fault::odometry_stale:
    case Fault::range_lost:
    case Fault::range_stuck:
    case Fault::log_full:
    case Fault::record_failed:
      return FaultAction::degrade;
    case Fault::bad_frame:
    case Fault::new_map:
    case Fault::map_full:
    case Fault::archive_full:
    case Fault::archive_failed:
    case Fault::frame_dropped:
    case Fault::result_dropped:
    case Fault::deadline_missed:
    case Fault::clock_jump:
    case Fault::foreign_message:
    case Fault::realtime_refused:
    case Fault::heap_used:
      return FaultAction::count;
  }
  return FaultAction::count;
}

Mode mode_of(const ModeInputs& in) {
  if (in.stopping) return Mode::safe_stop;
  if (!in.source_open) return Mode::boot;
  FaultAction worst = FaultAction::count;
  for (uint32_t i = 0; i < kFaults; ++i)
    if ((in.faults_active >> i & 1) != 0) worst = std::max(worst, action_of(static_cast<Fault>(i)));
  if (!in.frames) return worst == FaultAction::lose ? Mode::lost : Mode::ready;
  constexpr uint8_t kPoor = 1, kLost = 2;
  if (worst == FaultAction::lose || in.state == kLost) return Mode::lost;
  return worst == FaultAction::degrade || in.state == kPoor ? Mode::degraded : Mode::running;
}

const char* to_string(Mode mode) {
  switch (mode) {
    case Mode::boot:
      return "boot";
    case Mode::ready:
      return "ready";
    case Mode::running:
      return "running";
    case Mode::degraded:
      return "degraded";
    case Mode::lost:
      return "lost";
    case Mode::safe_stop:
      return "safe_stop";
  }
  return "unknown";
}

}  // namespace stillmap
