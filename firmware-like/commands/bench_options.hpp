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
  bool json = false;
};

/// Times of every step over a preloaded clip. @return the exit code
int bench_steps(const BenchOptions& options);

/// Trajectory and model errors on the synthetic scenes. @return the exit code
int bench_accuracy(const BenchOptions& options);

}  // namespace stillmap
