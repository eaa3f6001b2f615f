// GpioLines by libgpiod 1.x.

#include <gpiod.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/gpio/gpio_errors.hpp"
#include "drivers/gpio/gpio_lines.hpp"

namespace stillmap {
namespace {

constexpr const char* kConsumer = "stillmap sonar";

struct CloseChip {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
};
/// Closing it gives its lines back.
using Chip = std::unique_ptr<gpiod_chip, CloseChip>;

class Lines final : public GpioLines {
 public:
  /// @return what is wrong, or empty
  std::string open(const SonarConfig& sonar) {
    chip_.reset(gpiod_chip_open(sonar.chip.c_str()));
    if (!chip_) return gpio_chip_error(sonar.chip, errno);
    const auto output = [](bool high) {
      return [high](gpiod_line* line) { return gpiod_line_request_output(line, kConsumer, high ? 1 : 0); };
    };
    const auto input = [](gpiod_line* line) { return gpiod_line_request_both_edges_events(line, kConsumer); };
    // The stop line first: from the first moment on it says stop.
    std::string problem = take(sonar.chip, sonar.stop_line, stop_, output(true));
    if (problem.empty()) problem = take(sonar.chip, sonar.trigger_line, trigger_, output(false));
    if (problem.empty()) problem = take(sonar.chip, sonar.echo_line, echo_, input);
    return problem;
  }

  bool set_trigger(bool high) override { return set(trigger_, high); }
  bool set_stop(bool high) override { return set(stop_, high); }

  Status next_edge(EchoEdge& edge, int32_t timeout_ms) override {
    const timespec time{timeout_ms / 1000, timeout_ms % 1000 * 1'000'000L};
    const int found = gpiod_line_event_wait(echo_, &time);
    if (found < 0 && errno == EINTR) return Status::timeout;
    if (found < 0) return Status::unavailable;
    // A kernel that wakes nobody when a chip goes answers a question with an error.
    if (found == 0) return gpiod_line_get_value(echo_) < 0 ? Status::unavailable : Status::timeout;
    gpiod_line_event event{};
    if (gpiod_line_event_read(echo_, &event) != 0) return Status::unavailable;
    edge.stamp.ns = int64_t{event.ts.tv_sec} * 1'000'000'000 + event.ts.tv_nsec;
    edge.rising = event.event_type == GPIOD_LINE_EVENT_RISING_EDGE;
    return Status::ok;
  }

 private:
  template <class Request>
  std::string take(const std::string& chip, int32_t number, gpiod_line*& line, const Request& request) {
    if (number < 0) return {};
    const auto lines = static_cast<int>(gpiod_chip_num_lines(chip_.get()));
    if (number >= lines) return no_such_gpio_line(chip, number, lines);
    line = gpiod_chip_get_line(chip_.get(), static_cast<unsigned>(number));
    if (line == nullptr) return gpio_line_error(chip, number, errno, {});
    if (request(line) == 0) return {};
    const int error = errno;
    const char* used_by = gpiod_line_consumer(line);
    return gpio_line_error(chip, number, error, used_by ? used_by : "");
  }

  static bool set(gpiod_line* line, bool high) {
    return line == nullptr || gpiod_line_set_value(line, high ? 1 : 0) == 0;
  }

  Chip chip_;
  gpiod_line *trigger_ = nullptr, *echo_ = nullptr, *stop_ = nullptr;
};

}  // namespace

Result<std::unique_ptr<GpioLines>> open_gpio_lines(const SonarConfig& sonar) {
  auto lines = std::make_unique<Lines>();
  if (std::string problem = lines->open(sonar); !problem.empty())
    return Error{std::move(problem), ErrorKind::cannot_open};
  return std::unique_ptr<GpioLines>(std::move(lines));
}

std::string gpio_line_problem(const std::string& name, int32_t number) {
  const Chip chip(gpiod_chip_open(name.c_str()));
  if (!chip) return gpio_chip_error(name, errno);
  const auto lines = static_cast<int>(gpiod_chip_num_lines(chip.get()));
  if (number < 0 || number >= lines) return no_such_gpio_line(name, number, lines);
  gpiod_line* line = gpiod_chip_get_line(chip.get(), static_cast<unsigned>(number));
  if (line == nullptr) return gpio_line_error(name, number, errno, {});
  const char* used_by = gpiod_line_consumer(line);
  return gpiod_line_is_used(line) ? gpio_line_error(name, number, EBUSY, used_by ? used_by : "")
                                  : std::string();
}

}  // namespace stillmap
