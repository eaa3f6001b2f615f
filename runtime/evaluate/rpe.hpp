#pragma once

// Relative pose error over a fixed time as the TUM RGB-D benchmark's script defines it (the paper's figure of
// the relative error over time).

#include <string>
#include <vector>

#include "config/result.hpp"
#include "runtime/evaluate/statistics.hpp"
#include "runtime/evaluate/trajectory.hpp"

namespace stillmap {

struct RpeSample {
  Stamp stamp;                   ///< of the first pose of the estimate
  double translation_m = 0;      ///< as the script: |t| of (P0^-1 P1)(Q0^-1 Q1)^-1, P estimate, Q truth
  double translation_eq2_m = 0;  ///< as Eq. 2 of Sturm et al. and evo: |t| of (Q0^-1 Q1)^-1 (P0^-1 P1)
  double rotation_deg = 0;       ///< the same by either
};

struct RpeResult {
  Statistics translation_m, translation_eq2_m, rotation_deg;
  uint64_t truth_poses = 0, estimate_poses = 0;
  std::vector<RpeSample> samples;  ///< by stamp
};

/// For every pose of the estimate the one nearest to its stamp + delta_s (pairs that end in the last pose are
/// left out), for each end the truth nearest in time, no farther than twice the median interval of the truth.
/// All pairs.
/// @param delta_s > 0
/// @return an error when fewer than two pairs are left.                  test: rpe_test
Result<RpeResult> relative_pose_error(const Trajectory& truth, const Trajectory& estimate,
                                      double delta_s = 1.0);

/// `stamp,trans_m,rot_deg` for each sample.
std::string rpe_csv(const RpeResult& result);

}  // namespace stillmap
