#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "runtime/pipeline/pipeline.hpp"
#include "runtime/record/histogram.hpp"

namespace stillmap {

/// Gathers what report.json says about a run. Adding a frame does not allocate. @thread one
class Report {
 public:
  Report(std::string device, int32_t threads, uint64_t planned_bytes);

  /// @param period_s distance of the frame from the one before it, 0 where unknown: a frame that took longer
  /// is late
  void add(const FrameResult& result, double period_s);
  void set_map(const MapHealth& map) { map_ = map; }
  void set_counters(const PipelineCounters& counters) { counters_ = counters; }
  /// Frames that nobody looked at since a newer one was there.
  void set_dropped(uint64_t count) { dropped_ = count; }
  void set_heap_allocations(uint64_t count) { heap_allocations_ = count; }
  void set_faults(std::map<std::string, uint64_t, std::less<>> faults) { faults_ = std::move(faults); }

  const DurationHistogram& total_ms() const { return total_; }
  const DurationHistogram& integrate_ms() const { return integrate_; }
  double masked_fraction_mean() const;

  /// The text of report.json, keys as the contract lists them.
  std::string json() const;

 private:
  std::string device_;
  int32_t threads_;
  uint64_t planned_bytes_;
  uint64_t dropped_ = 0, heap_allocations_ = 0, deadline_misses_ = 0, measured_frames_ = 0;
  double masked_sum_ = 0;
  MapHealth map_;
  PipelineCounters counters_;
  std::map<std::string, uint64_t, std::less<>> faults_;
  DurationHistogram prepare_, track_, mask_, refine_, integrate_, total_;
};

/// Largest resident memory of this process so far.
uint64_t peak_rss_bytes();

}  // namespace stillmap
