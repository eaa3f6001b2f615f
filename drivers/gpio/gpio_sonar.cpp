#include "drivers/gpio/gpio_sonar.hpp"

#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "drivers/gpio/gpio_lines.hpp"
#include "runtime/core/clock.hpp"

namespace stillmap {
namespace {

/// At least; the sound leaves after its end, and a longer one does no harm.
constexpr long kTriggerPulse_ns = 10'000;
/// Stamps of edges are of now. Kernels before Linux 5.7 stamp with the wall clock.
constexpr int64_t kFarFromNow_ns = 10'000'000'000;
constexpr size_t kErrorBytes = 300;  ///< taken at boot: what goes wrong later is said without allocating

class GpioSonar final : public RangeSensor {
 public:
  explicit GpioSonar(const SonarConfig& sonar)
      : sonar_(sonar), gone_text_(sonar.chip + ": the GPIO lines are gone: ") {
    error_.reserve(kErrorBytes + gone_text_.size());
  }

  Status open() override {
    lines_.reset();
    auto lines = open_gpio_lines(sonar_);
    if (!lines) {
      error_.assign(lines.error());
      return Status::unavailable;
    }
    lines_ = std::move(*lines);
    return Status::ok;
  }

  Status trigger(Stamp& at) override {
    if (!lines_->set_trigger(true)) return gone(errno);
    const timespec pulse{0, kTriggerPulse_ns};
    clock_nanosleep(CLOCK_MONOTONIC, 0, &pulse, nullptr);
    // Before the fall: the echo that follows it is never earlier than what it answers.
    at.ns = monotonic_ns();
    return lines_->set_trigger(false) ? Status::ok : gone(errno);
  }

  Status next_edge(EchoEdge& edge, int32_t timeout_ms) override {
    const Status status = lines_->next_edge(edge, timeout_ms);
    if (status == Status::unavailable) return gone(errno);
    if (status == Status::ok && std::abs(monotonic_ns() - edge.stamp.ns) > kFarFromNow_ns) {
      error_.assign("edges are not stamped with CLOCK_MONOTONIC: Linux 5.7 or later is needed");
      return Status::unavailable;
    }
    return status;
  }

  Status set_stop(bool high) override { return lines_->set_stop(high) ? Status::ok : gone(errno); }

  const std::string& error() const override { return error_; }

 private:
  Status gone(int error) {
    char text[80] = {};
    error_.assign(gone_text_).append(strerror_r(error, text, sizeof text));
    return Status::unavailable;
  }

  const SonarConfig sonar_;
  const std::string gone_text_;
  std::unique_ptr<GpioLines> lines_;
  std::string error_;
};

}  // namespace

Result<std::unique_ptr<RangeSensor>> make_gpio_sonar(const SonarConfig& sonar) {
  return std::unique_ptr<RangeSensor>(std::make_unique<GpioSonar>(sonar));
}

std::string sonar_line_problem(const std::string& chip, int32_t line) {
  return gpio_line_problem(chip, line);
}

std::string gpio_library() {
  return STILLMAP_GPIO_LIBRARY;
}

}  // namespace stillmap
