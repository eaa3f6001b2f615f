#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/run.hpp"
#include "runtime/pipeline/pipeline.hpp"

namespace stillmap {
namespace {

constexpr uint32_t kLoop = 90;          ///< frames of the loop
constexpr double kMostGrowth_mb = 1.0;  ///< bar

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  uint64_t pages = 0, resident = 0;
  statm >> pages >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) * 1e-6;
}

/// Looks at the resident memory over a run.
class MemoryWatch final : public FrameObserver {
 public:
  /// @param frames of the run: what is there after a tenth of them is what stays
  explicit MemoryWatch(uint32_t frames) : settled_(std::max(frames / 10, 2 * kLoop)) {}

  void begin(const FrameSource&, const SourceInfo&) override {}
  void see(const RgbdFrame&, const FrameResult&, const Engine&) override {
    ++frames_;
    if (frames_ == settled_) settled_mb_ = resident_mb();
    if (frames_ >= settled_ && frames_ % kLoop == 0) last_mb_ = resident_mb();
  }
  uint32_t frames() const { return frames_; }
  double settled_mb() const { return settled_mb_; }
  double growth_mb() const { return frames_ > settled_ ? last_mb_ - settled_mb_ : 0; }

 private:
  const uint32_t settled_;
  uint32_t frames_ = 0;
  double settled_mb_ = 0, last_mb_ = 0;
};

}  // namespace

int bench_soak(const BenchOptions& o) {
  RunOptions run_options;
  run_options.source = !o.sources.empty()
                           ? o.sources.front()
                           : "synthetic:crowd,seconds=3,size=" + (o.size.empty() ? "160x120" : o.size);
  run_options.out = o.out + "/soak";
  run_options.config = o.configs.empty() ? std::string() : o.configs.front();
  run_options.loop_frames = kLoop;
  run_options.max_frames = o.max_frames > 0 ? o.max_frames : 10000;
  run_options.quiet = true;
  run_options.lcm = o.lcm;
  // Every output is on, each of them bounded; each has begun anew, and taken the memory that it needs for
  // that, before the settled state is looked at.
  run_options.settings = {"record.log=true",         "record.frames=true",        "record.map=true",
                          "record.map_every_s=5",    "record.log_file_bytes=2e6", "record.log_max_bytes=8e6",
                          "record.stream_bytes=5e4", "record.mesh=false"};
  run_options.settings.insert(run_options.settings.end(), o.settings.begin(), o.settings.end());
  MemoryWatch memory(run_options.max_frames);
  const int code = run(run_options, &memory);
  if (code != kExitDone) return code;
  std::ifstream file(run_options.out + "/report.json");
  const auto report = nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  const int64_t heap_calls =
      report.is_discarded() ? -1 : report.value("heap_allocations_in_loop", int64_t{-1});
  const bool good =
      heap_calls == 0 && memory.growth_mb() < kMostGrowth_mb && memory.frames() == run_options.max_frames;
  if (o.json)
    fmt::print("{}\n", nlohmann::json{{"frames", memory.frames()},
                                      {"heap_calls", heap_calls},
                                      {"resident_mb", memory.settled_mb()},
                                      {"growth_mb", memory.growth_mb()},
                                      {"good", good}}
                           .dump());
  else
    fmt::print(
        "{} frames: {} heap calls on real-time threads (bar 0), resident {:.1f} MB, grown by {:.2f} MB (bar "
        "{})\n",
        memory.frames(), heap_calls, memory.settled_mb(), memory.growth_mb(), kMostGrowth_mb);
  return good ? kExitDone : kExitFailed;
}

}  // namespace stillmap
