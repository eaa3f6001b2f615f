#include "firmware-like/commands/progress.hpp"
#include "firmware-like/journal.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace stillmap {
namespace {

double seconds_between(std::chrono::steady_clock::time_point a, std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

}  // namespace

Progress::Progress(int64_t frames, bool quiet)
    : frames_(frames), quiet_(quiet || journal_reads()), terminal_(isatty(STDOUT_FILENO) == 1) {}

void Progress::show(const FrameResult& r, uint32_t frames_done) {
  if (quiet_) return;
  const auto now = Clock::now();
  const double since = seconds_between(last_, now);
  if (since < (terminal_ ? 0.2 : 1.0)) return;
  const double rate = (frames_done - frames_at_last_) / since;
  const double fill = r.map.capacity == 0 ? 0 : 100.0 * r.map.blocks / r.map.capacity;
  const std::string of = frames_ >= 0 ? fmt::format("/{}", frames_) : "";
  const std::string line =
      fmt::format("frame {}{}  {:.1f} frames/s  tracking {}  masked {:.0f} %  map {:.0f} % full", frames_done,
                  of, rate, to_string(r.state), 100.0 * static_cast<double>(r.masked_fraction), fill);
  if (terminal_)
    std::printf("\r\033[K%s", line.c_str());
  else
    std::printf("%s\n", line.c_str());
  std::fflush(stdout);
  line_open_ = terminal_;
  last_ = now;
  frames_at_last_ = frames_done;
}

void Progress::finish() {
  if (line_open_) std::printf("\r\033[K");
  line_open_ = false;
}

double Progress::seconds() const {
  return seconds_between(start_, Clock::now());
}

}  // namespace stillmap
