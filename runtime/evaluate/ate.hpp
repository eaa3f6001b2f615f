#pragma once

// Absolute trajectory error as the TUM RGB-D benchmark defines it (Sturm et al., IROS 2012; the paper's
// Tables II, III).

#include <cstdint>
#include <vector>

#include "config/result.hpp"
#include "runtime/evaluate/statistics.hpp"
#include "runtime/evaluate/trajectory.hpp"

namespace stillmap {

/// Indices of a pose of each trajectory that stand for the same moment.
struct PosePair {
  uint32_t truth = 0;
  uint32_t estimate = 0;
};

/// Greedy association: of all pairs nearer than `max_dt_s` the one with the smallest stamp difference first,
/// each pose once; equal differences by stamp of truth. O(n log n), memory O(n), for any max_dt_s.
/// @return in the order of the stamps.                                   test: ate_test
std::vector<PosePair> associate(const Trajectory& truth, const Trajectory& estimate, double max_dt_s);

struct AteResult {
  Statistics translation_m;
  uint64_t truth_poses = 0, estimate_poses = 0;
  Se3d T_truth_estimate;  ///< the alignment: rotation and translation, no scale
  std::vector<PosePair> pairs;
  std::vector<double> errors_m;  ///< of each pair

  double matched_share_estimate() const;  ///< matched poses over poses of the estimate
  double matched_share_truth() const;     ///< matched poses over poses of the truth
};

/// @param max_dt_s > 0
/// @return an error when fewer than two poses match.                     test: ate_test
Result<AteResult> absolute_trajectory_error(const Trajectory& truth, const Trajectory& estimate,
                                            double max_dt_s = 0.02);

}  // namespace stillmap
