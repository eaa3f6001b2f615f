#pragma once

#include <memory>
#include <string>

#include "config/config.hpp"
#include "config/result.hpp"
#include "runtime/ports/range_sensor.hpp"

namespace stillmap {

/// The sonar that the configuration describes, on GPIO lines that are not opened yet.
/// @param sonar kind is not none
/// @return kind bad_usage: this build has no libgpiod.  @thread boot
Result<std::unique_ptr<RangeSensor>> make_gpio_sonar(const SonarConfig& sonar);

/// What keeps a line from being taken now: no such chip or line, in use, not permitted, no libgpiod in this
/// build. One line; empty: nothing.  @thread boot
std::string sonar_line_problem(const std::string& chip, int32_t line);

/// What lines are driven by: "libgpiod 1.6.3"; empty: this build has none.
std::string gpio_library();

}  // namespace stillmap
