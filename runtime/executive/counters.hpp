#pragma once

#include <atomic>
#include <cstdint>

#include "runtime/core/fault.hpp"
#include "runtime/ports/messages.hpp"

namespace stillmap {

/// Bits of RunState::requests.
inline constexpr uint32_t kSaveMapRequest = 1, kResetRequest = 2;
/// Of RunState::saves.
inline constexpr uint32_t kSaveDone = 1, kSaveFailed = 2;

/// A thread's sign of life.
struct Heartbeat {
  std::atomic<uint64_t> beats{0};
  void beat() { beats.fetch_add(1, std::memory_order_relaxed); }
};

/// What all threads of a run tell each other sideways: numbers, nothing that waits.
/// @thread any
struct RunState {
  FaultBoard faults;
  std::atomic<uint32_t> frames_read{0};      ///< from the source, bad ones included
  std::atomic<uint32_t> frames_dropped{0};   ///< a newer one was there before they were looked at
  std::atomic<uint32_t> results_dropped{0};  ///< publish or record was behind
  std::atomic<uint32_t> deadline_misses{0};
  std::atomic<uint32_t> pose_epoch{0};
  std::atomic<uint64_t> map_id{0};
  std::atomic<uint8_t> shed{0};  ///< Shed
  std::atomic<uint32_t> command_id{0};
  std::atomic<uint8_t> command_result{0};  ///< CommandResult
  std::atomic<uint8_t> mode{0};            ///< Mode, as the supervisor sees it
  std::atomic<bool> stop{false};           ///< asked for
  std::atomic<uint32_t> requests{0};       ///< kSaveMapRequest, kResetRequest: for the real-time thread
  std::atomic<uint32_t> saves{0};          ///< of the map, since it was set to 0: kSaveDone or kSaveFailed
  std::atomic<int64_t> last_frame_ns{0};   ///< CLOCK_MONOTONIC, when the last frame was read
  std::atomic<int64_t> last_stamp_ns{0};   ///< of that frame, the source's clock
  Heartbeat capture, real_time, publish, record, sonar;
};

}  // namespace stillmap
