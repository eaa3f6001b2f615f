#include "firmware-like/metrics_text.hpp"

#include <fmt/format.h>

#include <iterator>

#include "runtime/executive/mode.hpp"

namespace stillmap {
namespace {

class Text {
 public:
  void gauge(const char* name, const char* help, double value) {
    head(name, help, "gauge").line(name, value);
  }
  void counter(const char* name, const char* help, double value) {
    head(name, help, "counter").line(name, value);
  }
  Text& head(const char* name, const char* help, const char* type) {
    fmt::format_to(std::back_inserter(text_), "# HELP stillmap_{0} {1}\n# TYPE stillmap_{0} {2}\n", name,
                   help, type);
    return *this;
  }
  void line(const char* name, double value) {
    fmt::format_to(std::back_inserter(text_), "stillmap_{} {}\n", name, value);
  }
  void labelled(const char* name, const char* label, std::string_view of, double value) {
    fmt::format_to(std::back_inserter(text_), "stillmap_{}{{{}=\"{}\"}} {}\n", name, label, of, value);
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

double seconds(float ms) {
  return static_cast<double>(ms) * 1e-3;
}

}  // namespace

std::string metrics_text(const StatusMessage& s) {
  Text out;
  out.head("mode", "1 for the mode that the program is in", "gauge");
  for (const Mode mode :
       {Mode::boot, Mode::ready, Mode::running, Mode::degraded, Mode::lost, Mode::safe_stop})
    out.labelled("mode", "mode", to_string(mode), mode == s.mode ? 1 : 0);
  out.gauge("tracking_state", "0 good, 1 poor, 2 lost", s.state);
  out.gauge("frame_rate_hertz", "processed frames a second", static_cast<double>(s.rate_hz));
  out.gauge("pose_age_seconds", "capture to datagram of the last pose", seconds(s.pose_age_ms));
  out.head("stage_seconds", "time of each step of the last frame", "gauge");
  for (const auto& [name, ms] : {std::pair{"prepare", s.prepare_ms}, std::pair{"track", s.track_ms},
                                 std::pair{"mask", s.mask_ms}, std::pair{"refine", s.refine_ms},
                                 std::pair{"integrate", s.integrate_ms}, std::pair{"total", s.total_ms}})
    out.labelled("stage_seconds", "stage", name, seconds(ms));
  out.gauge("inlier_ratio", "of the points that have a value in the map",
            static_cast<double>(s.inlier_ratio));
  out.gauge("masked_fraction", "of the pixels", static_cast<double>(s.masked_fraction));
  out.gauge("pose_good_probability", "that the pose is good", static_cast<double>(s.p_good));
  out.gauge("map_fill_ratio", "of the fullest pool", static_cast<double>(s.map_fill));
  out.gauge("map_blocks", "in use", s.map_blocks);
  out.gauge("shed_level", "work left out: 0 nothing to 2", static_cast<double>(s.shed));
  out.counter("frames_dropped_total", "a newer frame was there", s.frames_dropped);
  out.counter("results_dropped_total", "publish or record was behind", s.results_dropped);
  out.counter("deadline_misses_total", "frames that took longer than the camera's period", s.deadline_misses);
  out.counter("pose_epoch_total", "discontinuities of the pose", s.pose_epoch);
  out.head("faults_total", "by name", "counter");
  for (uint32_t i = 0; i < kFaults; ++i)
    out.labelled("faults_total", "fault", name_of(static_cast<Fault>(i)), s.fault_count[i]);
  out.head("fault_active", "1 while it holds", "gauge");
  for (uint32_t i = 0; i < kFaults; ++i)
    out.labelled("fault_active", "fault", name_of(static_cast<Fault>(i)),
                 static_cast<double>(s.faults_active >> i & 1));
  return out.take();
}

}  // namespace stillmap
