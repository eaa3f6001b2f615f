#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stillmap {

/// The flags of `stillmap bench`.
struct BenchOptions {
  std::string what = "steps";
  std::vector<std::string> configs, settings, sources;
  std::string out = "out/bench";
  int32_t frames = 60;
  uint32_t seeds = 1;
  std::string size;                          ///< "WxH" of synthetic scenes; "": as they say
  std::string seconds;                       ///< of synthetic scenes; "": as they say
  bool twins = false;                        ///< with each dynamic scene named by --source its static twin
  uint32_t skip_frames = 0, max_frames = 0;  ///< of recordings
  int32_t seed = 1;
  bool brief = false;
  bool json = false;
  std::string lcm = "off";
};

/// Times of every step over a preloaded clip. @return the exit code
int bench_steps(const BenchOptions& options);

/// Both presets against truth on the synthetic scenes, and on recordings. @return the exit code
int bench_accuracy(const BenchOptions& options);

/// Kidnappings to seen and unseen places. @return the exit code; failed when a bar is missed
int bench_relocalise(const BenchOptions& options);

/// The time of a frame beside 1, 10 and 50 copies of its map. @return the exit code; failed above 1.1 times
int bench_scale(const BenchOptions& options);

/// What both forms of free space know and take. @return the exit code; failed when a bar is missed
int bench_free_space(const BenchOptions& options);

/// A long run over a few frames with every output on. @return the exit code; failed when a real-time thread
/// used the heap or the memory grew
int bench_soak(const BenchOptions& options);

}  // namespace stillmap
