#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

#include "drivers/lcm/lcm.hpp"
#include "drivers/lcm/listener.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "firmware-like/commands/top_view.hpp"

namespace stillmap {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_between(Clock::time_point a, Clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

/// What came in, for whoever draws it. @thread hear: listening; view: one other
class Heard {
 public:
  void hear(std::string_view channel, View<const uint8_t> payload) {
    const std::lock_guard lock(mutex_);
    if (channel == kStatusChannel)
      take(payload, view_.status, status_came_);
    else if (channel == kPoseChannel && take(payload, view_.pose, pose_came_))
      ++poses_;
    else if (channel == kRangeChannel)
      take(payload, view_.range, range_came_);
  }

  /// @param now later than at the call before, from which the rate counts
  TopView view(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    TopView view = view_;
    view.seconds = seconds_between(start_, now);
    view.status_age_s = seconds_between(status_came_, now);
    view.pose_age_s = seconds_between(pose_came_, now);
    view.range_age_s = seconds_between(range_came_, now);
    view.poses_per_s = poses_ / seconds_between(viewed_, now);
    viewed_ = now;
    poses_ = 0;
    return view;
  }

 private:
  template <class Message>
  bool take(View<const uint8_t> payload, std::optional<Message>& last, Clock::time_point& came) {
    Message message;
    if (codec_->decode(payload, message) != Status::ok) {
      ++view_.foreign;
      return false;
    }
    last = message;
    came = Clock::now();
    return true;
  }

  const std::unique_ptr<MessageCodec> codec_ = make_lcm_codec();
  const Clock::time_point start_ = Clock::now();
  std::mutex mutex_;
  TopView view_;
  Clock::time_point status_came_ = start_, pose_came_ = start_, range_came_ = start_, viewed_ = start_;
  uint32_t poses_ = 0;  ///< since then
};

struct TopOptions {
  std::string url = kLcmDefaultUrl;
  double for_s = 0;  ///< 0: until it is stopped
};

/// @return false: nobody reads any more
bool draw(const TopView& view, bool terminal) {
  if (terminal)
    std::printf("\033[H\033[J%s", top_screen(view).c_str());
  else
    std::printf("%s\n", top_line(view).c_str());
  return std::fflush(stdout) == 0;
}

int show(const TopOptions& o) {
  Heard heard;
  const auto listener = LcmListener::open(
      o.url,
      [&heard](std::string_view channel, View<const uint8_t> payload) { heard.hear(channel, payload); });
  if (!listener) return fail("--lcm: " + listener.error(), listener.error_kind());
  catch_stop_signals();

  const bool terminal = isatty(STDOUT_FILENO) == 1;
  constexpr std::chrono::milliseconds kTick{50};
  const auto period = std::chrono::milliseconds(terminal ? 200 : 1000);
  const auto start = Clock::now();
  bool anything = false, time_left = true;
  for (auto next = start + period; !stop_requested() && time_left; std::this_thread::sleep_for(kTick)) {
    const auto now = Clock::now();
    time_left = o.for_s == 0 || seconds_between(start, now) < o.for_s;
    if (now < next && time_left) continue;
    next += period;
    TopView view = heard.view(now);
    view.url = o.url;
    view.connected = (*listener)->connected();
    anything = anything || view.status.has_value();
    if (!draw(view, terminal)) break;
  }
  return o.for_s > 0 && !anything ? kExitFailed : kExitDone;
}

}  // namespace

void add_top(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("top", "live view of a running program, over LCM");
  auto options = std::make_shared<TopOptions>();
  command->add_option("--lcm", options->url, "URL that `run` publishes to")->capture_default_str();
  command
      ->add_option("--for", options->for_s, "seconds after which it ends, 1 if it heard nothing (0: never)")
      ->check(CLI::Range(0.0, 1e6));
  command->callback([options, &exit_code] { exit_code = show(*options); });
}

}  // namespace stillmap
