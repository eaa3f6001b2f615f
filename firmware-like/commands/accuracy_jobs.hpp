#pragma once

// Which runs `stillmap bench accuracy` is made of.

#include <string>
#include <vector>

#include "config/result.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/run_options.hpp"
#include "runtime/evaluate/accuracy.hpp"

namespace stillmap {

struct AccuracyJob {
  AccuracyRun run;  ///< who it is; without figures
  RunOptions options;
  std::string truth;  ///< true trajectory of a recording; empty: the truth.txt that the run leaves
};

/// Scenes and their twins, each with every seed and preset; recordings once with every preset.
/// @return an error of kind bad_usage when the paper preset is to be used and is not found
Result<std::vector<AccuracyJob>> accuracy_jobs(const BenchOptions& options);

}  // namespace stillmap
