#pragma once

#include <cstdint>

#include "runtime/core/fault.hpp"
#include "runtime/ports/messages.hpp"

namespace stillmap {

/// What a fault means for the whole while it holds.
enum class FaultAction : uint8_t {
  count,    ///< it is counted and said
  degrade,  ///< what leaves is worth less: mode degraded
  lose,     ///< there is no pose: mode lost
};

/// The one table of policy: every fault, and what it leads to while it holds.
FaultAction action_of(Fault fault);

/// What the mode follows from.
struct ModeInputs {
  bool source_open = false;  ///< the source is there
  bool frames = false;       ///< at least one was processed
  bool stopping = false;
  uint8_t state = 2;           ///< TrackingState of the last frame
  uint64_t faults_active = 0;  ///< bit n: Fault n holds
};

/// boot until the source is open, ready until its first frame, then by the faults that hold and the tracking
/// state; safe_stop once a stop was asked for. test: mode_test
Mode mode_of(const ModeInputs& inputs);

const char* to_string(Mode mode);

}  // namespace stillmap
