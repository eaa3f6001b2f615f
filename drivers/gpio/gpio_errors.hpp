#pragma once

// Errors of GPIO chips and lines in words.

#include <string>

namespace stillmap {

/// @param error errno
std::string gpio_chip_error(const std::string& chip, int error);
/// @param used_by its consumer as the kernel knows it; may be empty
std::string gpio_line_error(const std::string& chip, int line, int error, const std::string& used_by);
std::string no_such_gpio_line(const std::string& chip, int line, int lines);

}  // namespace stillmap
