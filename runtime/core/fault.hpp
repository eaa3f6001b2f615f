#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string_view>

namespace stillmap {

/// What may go wrong in a running program without ending it. The order is that of the bits in
/// STILLMAP_STATUS: add at the end, never change.
enum class Fault : uint8_t {
  bad_frame,       ///< a frame could not be used
  camera_stalled,  ///< no frame for source.stall_s
  camera_gone,     ///< the source broke off
  tracking_lost,
  new_map,   ///< the map was given up
  map_full,  ///< something was not mapped
  archive_full,
  archive_failed,
  record_failed,   ///< a file could not be written
  log_full,        ///< the event log has no room on the disk
  frame_dropped,   ///< a newer frame was there before this one was looked at
  result_dropped,  ///< publish or record did not keep up
  deadline_missed,
  work_shed,
  clock_jump,       ///< the wall clock stepped
  bus_unavailable,  ///< a message could not be sent
  foreign_message,  ///< a message on our channels that is none of ours
  odometry_stale,
  realtime_refused,  ///< priority, CPU set or locked memory
  heap_used,         ///< an armed thread allocated
  device_failed,     ///< the accelerator
  thread_stalled,    ///< a thread of ours gave no sign of life
  range_lost,        ///< the sonar gives no echo
  range_stuck        ///< its line does not move
};
inline constexpr uint32_t kFaults = 24;

/// As in events.log and report.json.  @thread any
std::string_view name_of(Fault fault);

/// Latched faults: a bit each, how often, when first and last; and whether it holds now.
/// @thread any; neither waits nor allocates
class FaultBoard {
 public:
  struct Entry {
    uint32_t count = 0;
    int64_t first_ns = 0, last_ns = 0;  ///< CLOCK_MONOTONIC
  };

  /// It happened (once more).
  void raise(Fault fault, int64_t now_ns, uint32_t times = 1);
  /// It happened and goes on, until `clear`. Counted when it begins.
  void hold(Fault fault, int64_t now_ns);
  void clear(Fault fault);

  Entry entry(Fault fault) const;
  uint64_t latched() const { return latched_.load(std::memory_order_relaxed); }
  uint64_t active() const { return active_.load(std::memory_order_relaxed); }

 private:
  struct Cell {
    std::atomic<uint32_t> count{0};
    std::atomic<int64_t> first_ns{0}, last_ns{0};
  };
  std::array<Cell, kFaults> cells_;
  std::atomic<uint64_t> latched_{0}, active_{0};
};

}  // namespace stillmap
