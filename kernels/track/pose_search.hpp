#pragma once

// Levenberg-Marquardt over sub-samplings (paper section III-B) as a state that takes the sums of one pass
// after the other: on the CPU between two passes, on the GPU in the last block of one, so that no iteration
// waits for the host.

#include "kernels/base/normal_eq.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/engine.hpp"
#include "kernels/params.hpp"

namespace stillmap {

namespace pose_search_detail {

STILLMAP_HD bool is_finite(double x) {
  return x - x == 0.0;
}

/// Adds the prior as a residual of the pose: gradient, Hessian and cost.
/// @param scale of its information, into units of a pass over every `step`-th pixel
STILLMAP_HD void add_prior(const PosePrior& prior, double scale, const Se3& T_now, NormalEq& sums) {
  const Se3d T = cast<double>(T_now), expected = cast<double>(prior.T_world_cam);
  const Vec3d v = T.translation - expected.translation;
  const Vec3d w = log_rotation(T.rotation * transposed(expected.rotation));
  const double x[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
  double slope[6] = {}, cost = 0;
  for (int r = 0, k = 0; r < 6; ++r)
    for (int c = r; c < 6; ++c, ++k) {
      const double information = scale * static_cast<double>(prior.information[k]);
      sums.sum[kHessian + k] += information;
      slope[r] += information * x[c];
      if (c != r) slope[c] += information * x[r];
    }
  for (int i = 0; i < 6; ++i) {
    sums.sum[kGradient + i] += slope[i];
    cost += x[i] * slope[i];
  }
  sums.sum[kCost] += cost;
}

struct Step {
  Se3 T_map_cam;
  double translation_m = 0, rotation_rad = 0;
};

/// Gauss-Newton step with damping; false when the system is singular.
STILLMAP_HD bool solve_step(const NormalEq& sums, double damping, const Se3& T_map_cam, Step& step) {
  Cholesky6 cholesky;
  if (!cholesky.factor(sums.sum + kHessian, damping)) return false;
  double x[6];
  cholesky.solve(sums.sum + kGradient, x);
  const Vec3d v = {-x[0], -x[1], -x[2]}, w = {-x[3], -x[4], -x[5]};
  step.translation_m = norm(v);
  step.rotation_rad = norm(w);
  if (!is_finite(step.translation_m) || !is_finite(step.rotation_rad)) return false;
  const Se3d turn = exp(Twistd{{}, w});
  const Se3d T = cast<double>(T_map_cam);
  step.T_map_cam = cast<float>(Se3d{orthonormalized(turn.rotation * T.rotation), T.translation + v});
  return true;
}

STILLMAP_HD double mean_cost(const NormalEq& sums) {
  constexpr double kNothing = 1e300;
  return sums.sum[kWeight] > 0 ? sums.sum[kCost] / sums.sum[kWeight] : kNothing;
}

/// A step must lower the mean cost and may not do so by leaving the mapped space.
/// @param worse share of the cost by which it may rise all the same
STILLMAP_HD bool better(const NormalEq& candidate, const NormalEq& current, double worse = 0) {
  return candidate.sum[kPoints] >= 0.8 * current.sum[kPoints] &&
         mean_cost(candidate) < (1 + worse) * mean_cost(current);
}

}  // namespace pose_search_detail

/// One registration under way.                                              test: track_test
struct PoseSearch {
  Se3 T_map_cam;  ///< best so far
  Se3 T_try;      ///< the next pass is wanted here
  NormalEq sums;  ///< of the pass at T_map_cam, or less than a settled step away from it
  double damping = 0;
  double step_m = 0, step_rad = 0;  ///< of the step to T_try
  int32_t iterations = 0;           ///< steps tried, all levels
  int32_t steps_left = 0;           ///< at this level, at most
  int32_t step_px = 1;              ///< a pass takes every so manieth pixel
  bool at_start = false;            ///< the next pass is the first of its level
  bool level_done = true;           ///< no further pass is wanted at this level
  bool converged = false;           ///< the last step was small

  STILLMAP_HD void start(const Se3& T_start, const TrackParams& p) {
    *this = PoseSearch{};
    T_map_cam = T_try = T_start;
    damping = static_cast<double>(p.damping_initial);
  }
  /// The next pass is that of T_map_cam over every `step`-th pixel.
  STILLMAP_HD void start_level(int32_t step, int32_t most_steps) {
    T_try = T_map_cam;
    step_px = step;
    steps_left = most_steps;
    at_start = true;
    level_done = false;
  }
  /// Takes the sums of the pass at T_try, accepts or rejects the step that led there, and finds the next one.
  STILLMAP_HD void take(const NormalEq& pass, const PosePrior& prior, const TrackParams& p) {
    using namespace pose_search_detail;
    NormalEq candidate = pass;
    const double point_m = static_cast<double>(p.prior_point_m);
    add_prior(prior, point_m * point_m / (step_px * step_px), T_try, candidate);
    if (at_start) {
      sums = candidate;
      at_start = false;
    } else {
      judge(candidate, p);
    }
    if (level_done) return;
    Step step;
    if (steps_left == 0 || !solve_step(sums, damping, T_map_cam, step)) {
      level_done = true;
      return;
    }
    --steps_left;
    ++iterations;
    T_try = step.T_map_cam;
    step_m = step.translation_m;
    step_rad = step.rotation_rad;
    if (settled(p) && (steps_left == 0 || small(p))) take_unseen(p);
  }

 private:
  STILLMAP_HD bool small(const TrackParams& p) const {
    return step_m < static_cast<double>(p.converged_m) && step_rad < static_cast<double>(p.converged_rad);
  }
  /// The points that come and go with a step this short change the mean cost by more than the step does: what
  /// the cost says of it is noise, the step itself is the sum of all points.
  STILLMAP_HD bool settled(const TrackParams& p) const {
    return step_m < static_cast<double>(p.settled_m) && step_rad < static_cast<double>(p.settled_rad);
  }
  STILLMAP_HD void take_unseen(const TrackParams& p) {
    T_map_cam = T_try;
    converged = small(p);
    level_done = true;
  }
  STILLMAP_HD void judge(const NormalEq& candidate, const TrackParams& p) {
    using pose_search_detail::better;
    const bool lower = better(candidate, sums);
    const bool accepted =
        lower || (settled(p) && better(candidate, sums, static_cast<double>(p.settled_cost)));
    damping *= static_cast<double>(accepted ? p.damping_down : p.damping_up);
    if (accepted) {
      T_map_cam = T_try;
      sums = candidate;
    }
    converged = small(p);
    level_done = converged || (!lower && settled(p));
  }
};

/// Steps at most, at a level.
STILLMAP_HD int32_t iterations_at(const TrackParams& p, int32_t level) {
  return level == 0 ? p.iterations_fine : level == 1 ? p.iterations_middle : p.iterations_coarse;
}

}  // namespace stillmap
