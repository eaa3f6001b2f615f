#include "drivers/gpio/gpio_errors.hpp"

#include <cerrno>
#include <cstring>

namespace stillmap {

std::string gpio_chip_error(const std::string& chip, int error) {
  const std::string said = "sonar.chip = \"" + chip + "\": ";
  if (error == EACCES || error == EPERM)
    return said +
           "not permitted; sudo usermod -aG gpio $USER (and log in again), with the rule of "
           "60-stillmap.rules in /etc/udev/rules.d";
  if (error == ENOENT || error == ENODEV || error == ENXIO)
    return said + "there is no such GPIO chip; gpiodetect lists those that are";
  if (error == ENOTTY || error == EINVAL) return said + "is no GPIO chip; gpiodetect lists those that are";
  return said + std::strerror(error);
}

std::string gpio_line_error(const std::string& chip, int line, int error, const std::string& used_by) {
  const std::string said = chip + " line " + std::to_string(line) + ": ";
  if (error == EBUSY)
    return said + "in use" + (used_by.empty() ? "" : " by \"" + used_by + "\"") +
           "; end that program, or choose another line";
  if (error == EACCES || error == EPERM) return gpio_chip_error(chip, error);
  return said + std::strerror(error);
}

std::string no_such_gpio_line(const std::string& chip, int line, int lines) {
  return chip + " has the lines 0 to " + std::to_string(lines - 1) + ", not " + std::to_string(line) +
         "; gpioinfo names them";
}

}  // namespace stillmap
