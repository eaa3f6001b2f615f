#pragma once

// A sonar whose echo line says how far it is to the next thing; drivers implement it.

#include <cstdint>
#include <string>

#include "kernels/base/status.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// The echo line changed.
struct EchoEdge {
  Stamp stamp;  ///< CLOCK_MONOTONIC, of the edge itself
  bool rising = false;
};

/// What the sonar says at a moment.
struct RangeReading {
  Stamp stamp;        ///< CLOCK_MONOTONIC, when the sound was at what threw it back
  float range_m = 0;  ///< 0: no echo
  bool valid = false;
  bool stop = false;  ///< something is nearer than sonar.stop_m, or was and nothing has shown that it left
};

/// The lines of a sonar. After `unavailable` only `open` is of use.
/// @thread open: boot, then that of the sonar; all others: that of the sonar, neither allocating nor throwing
class RangeSensor {
 public:
  virtual ~RangeSensor() = default;

  /// Takes the lines, again where they were open; the stop line, where there is one, is high from then on.
  /// @return ok; unavailable: `error()` says which line and what to do
  virtual Status open() = 0;
  /// Asks for a reading: the pulse on the trigger line. Takes some ten microseconds.
  /// @param at when the sound left, CLOCK_MONOTONIC  @return ok; unavailable: the lines are gone
  virtual Status trigger(Stamp& at) = 0;
  /// Waits for the next edge of the echo line; none is left out while they are asked for.
  /// @return ok; timeout: none within the time; unavailable: the lines are gone
  virtual Status next_edge(EchoEdge& edge, int32_t timeout_ms) = 0;
  /// The stop line, where there is one.  @return ok; unavailable: the lines are gone
  virtual Status set_stop(bool high) = 0;

  /// One line about the last `unavailable`.
  virtual const std::string& error() const = 0;
};

}  // namespace stillmap
