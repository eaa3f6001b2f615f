// GpioLines by libgpiod 2.x.

#include <gpiod.h>

#include <cerrno>
#include <utility>

#include "drivers/gpio/gpio_errors.hpp"
#include "drivers/gpio/gpio_lines.hpp"

namespace stillmap {
namespace {

constexpr const char* kConsumer = "stillmap sonar";
constexpr size_t kEvents = 64;  ///< that the kernel keeps

/// A handle of the library with the function that frees it.
template <auto kFree>
struct Free {
  template <class T>
  void operator()(T* handle) const {
    kFree(handle);
  }
};
using Chip = std::unique_ptr<gpiod_chip, Free<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Free<gpiod_chip_info_free>>;
using LineInfo = std::unique_ptr<gpiod_line_info, Free<gpiod_line_info_free>>;
using Settings = std::unique_ptr<gpiod_line_settings, Free<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Free<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Free<gpiod_request_config_free>>;
using Request = std::unique_ptr<gpiod_line_request, Free<gpiod_line_request_release>>;
using Events = std::unique_ptr<gpiod_edge_event_buffer, Free<gpiod_edge_event_buffer_free>>;

/// Number of lines, or -1 with errno set.
int lines_of(gpiod_chip* chip) {
  const ChipInfo info(gpiod_chip_get_info(chip));
  return info ? static_cast<int>(gpiod_chip_info_get_num_lines(info.get())) : -1;
}

std::string consumer_of(gpiod_chip* chip, unsigned line) {
  const LineInfo info(gpiod_chip_get_line_info(chip, line));
  const char* consumer = info ? gpiod_line_info_get_consumer(info.get()) : nullptr;
  return consumer ? consumer : "";
}

Settings output(bool high) {
  Settings settings(gpiod_line_settings_new());
  if (!settings) return settings;
  gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT);
  gpiod_line_settings_set_output_value(settings.get(),
                                       high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE);
  return settings;
}

Settings both_edges() {
  Settings settings(gpiod_line_settings_new());
  if (!settings) return settings;
  gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT);
  gpiod_line_settings_set_edge_detection(settings.get(), GPIOD_LINE_EDGE_BOTH);
  gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC);
  return settings;
}

/// @return null, with errno set
Request request_line(gpiod_chip* chip, unsigned line, const Settings& settings) {
  const LineConfig config(gpiod_line_config_new());
  const RequestConfig request(gpiod_request_config_new());
  if (!settings || !config || !request ||
      gpiod_line_config_add_line_settings(config.get(), &line, 1, settings.get()) != 0)
    return {};
  gpiod_request_config_set_consumer(request.get(), kConsumer);
  gpiod_request_config_set_event_buffer_size(request.get(), kEvents);
  return Request(gpiod_chip_request_lines(chip, request.get(), config.get()));
}

class Lines final : public GpioLines {
 public:
  /// @return what is wrong, or empty
  std::string open(const SonarConfig& sonar) {
    chip_.reset(gpiod_chip_open(sonar.chip.c_str()));
    const int lines = chip_ ? lines_of(chip_.get()) : -1;
    if (lines < 0) return gpio_chip_error(sonar.chip, errno);
    events_.reset(gpiod_edge_event_buffer_new(1));
    if (!events_) return gpio_chip_error(sonar.chip, errno);
    const auto take = [&](int32_t number, Line& line, const Settings& settings) -> std::string {
      if (number < 0) return {};
      if (number >= lines) return no_such_gpio_line(sonar.chip, number, lines);
      line.offset = static_cast<unsigned>(number);
      line.request = request_line(chip_.get(), line.offset, settings);
      if (line.request) return {};
      const int error = errno;
      return gpio_line_error(sonar.chip, number, error, consumer_of(chip_.get(), line.offset));
    };
    // The stop line first: from the first moment on it says stop.
    std::string problem = take(sonar.stop_line, stop_, output(true));
    if (problem.empty()) problem = take(sonar.trigger_line, trigger_, output(false));
    if (problem.empty()) problem = take(sonar.echo_line, echo_, both_edges());
    return problem;
  }

  bool set_trigger(bool high) override { return trigger_.set(high); }
  bool set_stop(bool high) override { return stop_.set(high); }

  Status next_edge(EchoEdge& edge, int32_t timeout_ms) override {
    const int found =
        gpiod_line_request_wait_edge_events(echo_.request.get(), int64_t{timeout_ms} * 1'000'000);
    if (found < 0 && errno == EINTR) return Status::timeout;
    if (found < 0) return Status::unavailable;
    // A kernel that wakes nobody when a chip goes answers a question with an error.
    if (found == 0)
      return gpiod_line_request_get_value(echo_.request.get(), echo_.offset) == GPIOD_LINE_VALUE_ERROR
                 ? Status::unavailable
                 : Status::timeout;
    if (gpiod_line_request_read_edge_events(echo_.request.get(), events_.get(), 1) != 1)
      return Status::unavailable;
    gpiod_edge_event* event = gpiod_edge_event_buffer_get_event(events_.get(), 0);
    edge.stamp.ns = static_cast<int64_t>(gpiod_edge_event_get_timestamp_ns(event));
    edge.rising = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE;
    return Status::ok;
  }

 private:
  struct Line {
    Request request;
    unsigned offset = 0;

    bool set(bool high) const {
      return !request ||
             gpiod_line_request_set_value(request.get(), offset,
                                          high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE) == 0;
    }
  };

  Chip chip_;
  Events events_;
  Line trigger_, echo_, stop_;
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
  const int lines = chip ? lines_of(chip.get()) : -1;
  if (lines < 0) return gpio_chip_error(name, errno);
  if (number < 0 || number >= lines) return no_such_gpio_line(name, number, lines);
  const LineInfo info(gpiod_chip_get_line_info(chip.get(), static_cast<unsigned>(number)));
  if (!info) return gpio_line_error(name, number, errno, {});
  return gpiod_line_info_is_used(info.get())
             ? gpio_line_error(name, number, EBUSY, consumer_of(chip.get(), static_cast<unsigned>(number)))
             : std::string();
}

}  // namespace stillmap
