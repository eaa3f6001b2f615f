#pragma once

#include <vector>

#include "firmware-like/commands/accuracy_jobs.hpp"
#include "runtime/evaluate/truth_observer.hpp"

namespace stillmap {

struct AccuracyOutcome {
  AccuracyRun run;
  std::vector<FrameAgainstTruth> frames;
};

/// Runs one scene with one preset and measures it against truth. What could not be measured stays unknown; a
/// run that failed says so in `run.error`.
AccuracyOutcome run_job(const AccuracyJob& job, bool keep_meshes);

}  // namespace stillmap
