#pragma once

// What `stillmap bench accuracy` writes: rows for programs.

#include <string>
#include <vector>

#include "runtime/evaluate/accuracy.hpp"
#include "runtime/evaluate/truth_observer.hpp"

namespace stillmap {

/// A line a run, all figures; unknown ones are empty.
std::string accuracy_csv(const std::vector<AccuracyRun>& runs);

std::string calibration_csv_head();
/// A line a frame of one run.
std::string calibration_csv(const AccuracyRun& run, const std::vector<FrameAgainstTruth>& frames);

/// `{"runs": [...], "summary": [...], "bars": [...]}`; unknown figures are null.
std::string accuracy_json(const std::vector<AccuracyRun>& runs);

}  // namespace stillmap
