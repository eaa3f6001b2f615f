#pragma once

// The paper's two tables beside our own figures, for the sequences that the user has.

#include <functional>
#include <string>
#include <vector>

#include "config/result.hpp"

namespace stillmap {

/// Runs the pipeline on a sequence folder. `config` is a file, or empty for the default.
/// @return path of the trajectory, or why there is none
using SuiteRun =
    std::function<Result<std::string>(const std::string& sequence_dir, const std::string& config)>;

struct SuiteResult {
  std::string text;        ///< both tables, then a line for each thing to know
  uint64_t evaluated = 0;  ///< figures of ours that stand in the tables
  uint64_t failed = 0;
};

/// Name of the paper's sequence that a folder is of (rgbd_bonn_balloon2 -> balloon2), empty when of none.
/// test: suite_test
std::string paper_sequence_of(const std::string& folder_name);

/// Looks for sequence folders (with depth.txt or associated.txt) in `dir` and two levels below, runs each
/// with each config, and sets RMSE of ATE against its groundtruth.txt into the tables; "-" where a sequence
/// is not there.
/// @param configs empty: the default alone
/// @return an error when `dir` cannot be read or holds none of the sequences
Result<SuiteResult> evaluate_suite(const std::string& dir, const std::vector<std::string>& configs,
                                   const SuiteRun& run);

}  // namespace stillmap
