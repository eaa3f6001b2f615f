#include "firmware-like/commands/top_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "runtime/pipeline/pose_quality.hpp"

namespace stillmap {
namespace {

template <class E, size_t N>
const char* name_in(const std::array<const char*, N>& names, E value) {
  return names[std::min(static_cast<size_t>(value), N - 1)];
}
const char* name_of(Mode mode) {
  return name_in(std::array{"boot", "ready", "running", "degraded", "lost", "safe_stop"}, mode);
}
const char* name_of(Shed shed) {
  return name_in(std::array{"nothing", "every second integration", "finest level"}, shed);
}
const char* name_of(CommandResult result) {
  return name_in(std::array{"none", "accepted", "done", "failed", "refused"}, result);
}

const char* tracking(const StatusMessage& s) {
  return to_string(static_cast<TrackingState>(s.state));
}

/// "NAME COUNT", and a mark where it holds now; of a newer program a fault may have no name here.
std::string fault_text(const StatusMessage& s, uint32_t fault) {
  const bool known = fault < kFaults;
  std::string text =
      known ? fmt::format("{} {}", stillmap::name_of(static_cast<Fault>(fault)), s.fault_count[fault])
            : fmt::format("fault {}", fault);
  if (s.faults_active >> fault & 1) text += " now";
  return text;
}

std::string faults(const StatusMessage& s, const char* between) {
  constexpr uint32_t kBits = 64;
  std::string text;
  for (uint32_t fault = 0; fault < kBits; ++fault)
    if (s.faults_latched >> fault & 1) text += (text.empty() ? "" : between) + fault_text(s, fault);
  return text.empty() ? "none" : text;
}

/// Why there is nothing to show.
std::string silence(const TopView& view) {
  const double silent_s = view.status ? view.status_age_s : view.seconds;
  std::string text = fmt::format("nothing heard for {:.0f} s on {}: ", silent_s, view.url);
  if (!view.connected)
    text +=
        "no network of this host has a route to it; `ip route add 224.0.0.0/4 dev lo` makes one within the "
        "host";
  else if (view.foreign > 0)
    text += fmt::format("{} messages were none of this version's", view.foreign);
  else
    text += "does `stillmap run --lcm URL` run with this URL? ttl=0 stays on its host, ttl=1 on its network";
  return text;
}

bool silent(const TopView& view) {
  return !view.status || view.status_age_s > kSilenceS;
}

std::string row(const char* title, const std::string& text) {
  return fmt::format("{:<10}{}\n", title, text);
}

std::string pose_text(const TopView& view) {
  if (!view.pose) return "none came";
  const PoseMessage& p = *view.pose;
  const std::string where = fmt::format("x {:.3f}  y {:.3f}  z {:.3f} m", p.pos_m[0], p.pos_m[1], p.pos_m[2]);
  if (view.pose_age_s > kSilenceS)
    return fmt::format("none for {:.0f} s, the last was {}", view.pose_age_s, where);
  return fmt::format("{}   {:.1f} a second", where, view.poses_per_s);
}

/// "0.42 m", and what else there is to say; empty: there is no sonar.
std::string range_text(const TopView& view) {
  if (!view.range) return {};
  const RangeMessage& r = *view.range;
  if (view.range_age_s > kSilenceS)
    return fmt::format("none for {:.0f} s{}", view.range_age_s, r.stop ? ", the last said stop" : "");
  const std::string where = r.range_m > 0 ? fmt::format("{:.2f} m", r.range_m) : std::string("no echo");
  return where + (r.range_m > 0 && !r.valid ? ", not believed" : "") + (r.stop ? ", stop" : "");
}

std::string status_rows(const TopView& view) {
  const StatusMessage& s = *view.status;
  return row("mode", name_of(s.mode)) +
         row("tracking", fmt::format("{}   sure {:.0f} %   inliers {:.0f} %   masked {:.0f} %", tracking(s),
                                     100 * s.p_good, 100 * s.inlier_ratio, 100 * s.masked_fraction)) +
         row("pose", pose_text(view)) +
         row("rate", fmt::format("{:.1f} frames a second   pose age {:.1f} ms   frame {}", s.rate_hz,
                                 s.pose_age_ms, s.frame)) +
         (view.range ? row("range", range_text(view)) : std::string()) +
         row("stages",
             fmt::format("prepare {:.1f}  track {:.1f}  mask {:.1f}  refine {:.1f}  integrate {:.1f}  "
                         "total {:.1f} ms",
                         s.prepare_ms, s.track_ms, s.mask_ms, s.refine_ms, s.integrate_ms, s.total_ms)) +
         row("map", fmt::format("{:.0f} % full   {} blocks   id {:016x}   pose epoch {}", 100 * s.map_fill,
                                s.map_blocks, s.map_id, s.pose_epoch)) +
         row("dropped", fmt::format("frames {}   results {}   deadlines missed {}", s.frames_dropped,
                                    s.results_dropped, s.deadline_misses)) +
         row("left out", name_of(s.shed)) +
         row("command", s.command_result == CommandResult::none
                            ? "none"
                            : fmt::format("{} {}", s.command_id, name_of(s.command_result))) +
         row("faults", faults(s, "\n          "));
}

}  // namespace

std::string top_screen(const TopView& view) {
  std::string text = fmt::format("stillmap top   {}\n\n", view.url);
  if (silent(view)) text += silence(view) + "\n\n";
  if (view.status) text += status_rows(view);
  if (view.foreign > 0) text += row("foreign", fmt::format("{} messages on these channels", view.foreign));
  return text;
}

std::string top_line(const TopView& view) {
  if (silent(view)) return silence(view);
  const StatusMessage& s = *view.status;
  return fmt::format(
      "mode {}  tracking {}  {:.1f} frames/s  {:.1f} poses/s  age {:.1f} ms  prepare {:.1f} track {:.1f} "
      "mask {:.1f} "
      "refine {:.1f} integrate {:.1f} total {:.1f} ms  map {:.0f} % full  dropped {} frames {} results  late "
      "{}  "
      "left out: {}  {}faults: {}",
      name_of(s.mode), tracking(s), s.rate_hz, view.poses_per_s, s.pose_age_ms, s.prepare_ms, s.track_ms,
      s.mask_ms, s.refine_ms, s.integrate_ms, s.total_ms, 100 * s.map_fill, s.frames_dropped,
      s.results_dropped, s.deadline_misses, name_of(s.shed),
      view.range ? fmt::format("range: {}  ", range_text(view)) : std::string(), faults(s, ", "));
}

}  // namespace stillmap
