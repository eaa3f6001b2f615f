#pragma once

// GPIO lines by the kernel's character device. One of two sources implements it, by the libgpiod that is
// there: gpio_lines_v1.cpp (1.5 and later) or gpio_lines_v2.cpp (2.x).

#include <cstdint>
#include <memory>
#include <string>

#include "config/config.hpp"
#include "config/result.hpp"
#include "runtime/ports/range_sensor.hpp"

namespace stillmap {

/// The lines of a sonar, taken from everybody else. A line that is not configured is not there: setting it
/// does nothing.
/// @thread one; nothing here allocates or throws
class GpioLines {
 public:
  /// Releases them.
  virtual ~GpioLines() = default;

  /// @return false, with errno set: the chip is gone
  virtual bool set_trigger(bool high) = 0;
  virtual bool set_stop(bool high) = 0;
  /// The next edge of the echo line; the kernel keeps 16 and more while nobody asks.
  /// @return ok; timeout; unavailable, with errno set: the chip is gone
  virtual Status next_edge(EchoEdge& edge, int32_t timeout_ms) = 0;
};

/// Trigger low, stop high, echo an input with both edges stamped.
/// @return one line that names chip and line, and what to do; kind cannot_open.  @thread boot, or that of the
/// sonar
Result<std::unique_ptr<GpioLines>> open_gpio_lines(const SonarConfig& sonar);

/// What keeps a line from being taken now: no such chip, no such line, in use, not permitted. One line;
/// empty: nothing.  @thread boot
std::string gpio_line_problem(const std::string& chip, int32_t line);

}  // namespace stillmap
