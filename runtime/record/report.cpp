#include "runtime/record/report.hpp"

#include <sys/resource.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "runtime/core/version.hpp"

namespace stillmap {
namespace {

using Json = nlohmann::ordered_json;

/// Microseconds are enough, and the file stays readable.
double rounded(double ms) {
  return std::round(ms * 1e3) / 1e3;
}

Json times(const DurationHistogram& h) {
  return {{"mean", rounded(h.mean())},
          {"p50", rounded(h.percentile(0.50))},
          {"p95", rounded(h.percentile(0.95))},
          {"p99", rounded(h.percentile(0.99))},
          {"max", rounded(h.max())}};
}

}  // namespace

Report::Report(std::string device, int32_t threads, uint64_t planned_bytes)
    : device_(std::move(device)), threads_(threads), planned_bytes_(planned_bytes) {}

void Report::add(const FrameResult& r, double period_s) {
  map_ = r.map;
  if (r.status == Status::bad_data) return;
  prepare_.add(static_cast<double>(r.ms.prepare_ms));
  track_.add(static_cast<double>(r.ms.track_ms));
  mask_.add(static_cast<double>(r.ms.mask_ms));
  refine_.add(static_cast<double>(r.ms.refine_ms));
  integrate_.add(static_cast<double>(r.ms.integrate_ms));
  total_.add(static_cast<double>(r.ms.total_ms));
  masked_sum_ += static_cast<double>(r.masked_fraction);
  ++measured_frames_;
  if (period_s > 0 && static_cast<double>(r.ms.total_ms) > period_s * 1e3) ++deadline_misses_;
}

double Report::masked_fraction_mean() const {
  return measured_frames_ == 0 ? 0.0 : masked_sum_ / static_cast<double>(measured_frames_);
}

std::string Report::json() const {
  Json faults = Json::object();
  for (const auto& [name, count] : faults_) faults[name] = count;
  const Json report = {{"version", version()},
                       {"device", device_},
                       {"threads", threads_},
                       {"frames", counters_.frames},
                       {"dropped", dropped_},
                       {"lost_frames", counters_.lost_frames},
                       {"relocalised", counters_.relocalised},
                       {"ms",
                        {{"prepare", times(prepare_)},
                         {"track", times(track_)},
                         {"mask", times(mask_)},
                         {"refine", times(refine_)},
                         {"integrate", times(integrate_)},
                         {"total", times(total_)}}},
                       {"map",
                        {{"blocks", map_.blocks},
                         {"free_blocks", map_.capacity - map_.blocks},
                         {"capacity", map_.capacity},
                         {"bytes", map_.bytes},
                         {"archived", map_.archived_groups}}},
                       {"memory", {{"planned_bytes", planned_bytes_}, {"peak_rss_bytes", peak_rss_bytes()}}},
                       {"heap_allocations_in_loop", heap_allocations_},
                       {"deadline_misses", deadline_misses_},
                       {"masked_fraction_mean", masked_fraction_mean()},
                       {"faults", faults}};
  return report.dump(2) + "\n";
}

uint64_t peak_rss_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts kilobytes
}

}  // namespace stillmap
