// In place of the driver where libgpiod was not there when this was configured.

#include "drivers/gpio/gpio_sonar.hpp"

namespace stillmap {
namespace {

constexpr const char* kMissing =
    "sonar: this build has no libgpiod; install libgpiod-dev and build again, or set sonar.kind = \"none\"";

}  // namespace

Result<std::unique_ptr<RangeSensor>> make_gpio_sonar(const SonarConfig& /*sonar*/) {
  return Error{kMissing, ErrorKind::bad_usage};
}

std::string sonar_line_problem(const std::string& /*chip*/, int32_t /*line*/) {
  return kMissing;
}

std::string gpio_library() {
  return {};
}

}  // namespace stillmap
