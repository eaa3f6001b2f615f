#include "kernels/track/track.hpp"

#include <cmath>

namespace stillmap {
namespace {

/// The prior as a residual of the pose: information in units of a pass over every `step`-th pixel.
struct Expected {
  Se3d T_map_cam;
  double information[21];

  Expected(const PosePrior& prior, double scale) : T_map_cam(cast<double>(prior.T_world_cam)) {
    for (int i = 0; i < 21; ++i) information[i] = scale * static_cast<double>(prior.information[i]);
  }
  /// Adds its gradient and Hessian at a pose. @return its cost
  double add_to(const Se3& T_now, NormalEq& sums) const {
    const Se3d T = cast<double>(T_now);
    const Vec3d v = T.translation - T_map_cam.translation;
    const Vec3d w = log_rotation(T.rotation * transposed(T_map_cam.rotation));
    const double x[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
    double slope[6] = {}, cost = 0;
    for (int r = 0, k = 0; r < 6; ++r)
      for (int c = r; c < 6; ++c, ++k) {
        sums.sum[kHessian + k] += information[k];
        slope[r] += information[k] * x[c];
        if (c != r) slope[c] += information[k] * x[r];
      }
    for (int i = 0; i < 6; ++i) {
      sums.sum[kGradient + i] += slope[i];
      cost += x[i] * slope[i];
    }
    return cost;
  }
};

struct Step {
  Se3 T_map_cam;
  double translation_m = 0, rotation_rad = 0;
};

/// Gauss-Newton step with damping; false when the system is singular.
bool solve_step(const NormalEq& sums, double damping, const Se3& T_map_cam, Step& step) {
  Cholesky6 cholesky;
  if (!cholesky.factor(sums.sum + kHessian, damping)) return false;
  double x[6];
  cholesky.solve(sums.sum + kGradient, x);
  const Vec3d v = {-x[0], -x[1], -x[2]}, w = {-x[3], -x[4], -x[5]};
  step.translation_m = norm(v);
  step.rotation_rad = norm(w);
  if (!std::isfinite(step.translation_m) || !std::isfinite(step.rotation_rad)) return false;
  const Se3d turn = exp(Twistd{{}, w});
  const Se3d T = cast<double>(T_map_cam);
  step.T_map_cam = cast<float>(Se3d{orthonormalized(turn.rotation * T.rotation), T.translation + v});
  return true;
}

double mean_cost(const NormalEq& sums) {
  return sums.sum[kWeight] > 0 ? sums.sum[kCost] / sums.sum[kWeight] : HUGE_VAL;
}

/// A step must lower the mean cost and may not do so by leaving the mapped space.
bool better(const NormalEq& candidate, const NormalEq& current) {
  return candidate.sum[kPoints] >= 0.8 * current.sum[kPoints] && mean_cost(candidate) < mean_cost(current);
}

struct State {
  Se3 T_map_cam;
  NormalEq sums;
  double damping;
  bool converged;  ///< the last step was small
};

/// A pass with the prior added.
NormalEq summed(const PassRunner& pass, const Se3& T_map_cam, int32_t step_px, const Expected& expected) {
  NormalEq sums = pass(T_map_cam, step_px);
  sums.sum[kCost] += expected.add_to(T_map_cam, sums);
  return sums;
}

/// One level: at most `iterations` steps, accepted or rejected.
int32_t run_level(const PassRunner& pass, int32_t step_px, int32_t iterations, const TrackParams& p,
                  const PosePrior& prior, State& state) {
  const double point_m = static_cast<double>(p.prior_point_m);
  const Expected expected(prior, point_m * point_m / (step_px * step_px));
  state.sums = summed(pass, state.T_map_cam, step_px, expected);
  int32_t i = 0;
  while (i < iterations) {
    Step step;
    if (!solve_step(state.sums, state.damping, state.T_map_cam, step)) return i;
    ++i;
    const NormalEq candidate = summed(pass, step.T_map_cam, step_px, expected);
    const bool accepted = better(candidate, state.sums);
    state.damping *= static_cast<double>(accepted ? p.damping_down : p.damping_up);
    if (accepted) {
      state.T_map_cam = step.T_map_cam;
      state.sums = candidate;
    }
    state.converged = step.translation_m < static_cast<double>(p.converged_m) &&
                      step.rotation_rad < static_cast<double>(p.converged_rad);
    if (state.converged) break;
  }
  return i;
}

/// Inverse Hessian times the residual variance, moved from the camera centre to the map's origin.
void write_covariance(const NormalEq& sums, Vec3 centre, float covariance[21]) {
  Cholesky6 cholesky;
  if (!cholesky.factor(sums.sum + kHessian, 0.0) || sums.sum[kInliers] < 1) return;
  const double variance = sums.sum[kSumSdf2] / sums.sum[kInliers];
  double about_centre[6][6];
  for (int c = 0; c < 6; ++c) {
    double unit[6] = {}, column[6];
    unit[c] = 1;
    cholesky.solve(unit, column);
    for (int r = 0; r < 6; ++r) about_centre[r][c] = variance * column[r];
  }
  // Left perturbation about the origin: v_origin = v_centre + centre x w.
  const double cx = static_cast<double>(centre.x), cy = static_cast<double>(centre.y),
               cz = static_cast<double>(centre.z);
  const double shift[6][6] = {{1, 0, 0, 0, -cz, cy}, {0, 1, 0, cz, 0, -cx}, {0, 0, 1, -cy, cx, 0},
                              {0, 0, 0, 1, 0, 0},    {0, 0, 0, 0, 1, 0},    {0, 0, 0, 0, 0, 1}};
  int k = 0;
  for (int r = 0; r < 6; ++r)
    for (int c = r; c < 6; ++c) {
      double sum = 0;
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) sum += shift[r][i] * about_centre[i][j] * shift[c][j];
      covariance[k++] = static_cast<float>(sum);
    }
}

}  // namespace

TrackResult register_frame(const PassRunner& pass, const Se3& T_start, const TrackParams& params,
                           LevelRange levels, int32_t min_points, const PosePrior& prior) {
  const int32_t iterations[3] = {params.iterations_fine, params.iterations_middle, params.iterations_coarse};
  TrackResult result;
  result.T_world_cam = T_start;
  State state{T_start, {}, static_cast<double>(params.damping_initial), false};
  for (int32_t level = levels.coarsest; level >= levels.finest; --level)
    result.iterations += run_level(pass, 1 << level, iterations[level], params, prior, state);

  const NormalEq& sums = state.sums;
  result.mapped_ratio =
      static_cast<float>(sums.sum[kConsidered] > 0 ? sums.sum[kPoints] / sums.sum[kConsidered] : 0);
  result.inlier_ratio =
      static_cast<float>(sums.sum[kPoints] > 0 ? sums.sum[kInliers] / sums.sum[kPoints] : 0);
  result.rmse_m =
      static_cast<float>(sums.sum[kInliers] > 0 ? std::sqrt(sums.sum[kSumSdf2] / sums.sum[kInliers]) : 0);
  Cholesky6 cholesky;
  if (sums.sum[kPoints] * (1 << 2 * levels.finest) < min_points ||
      !cholesky.factor(sums.sum + kHessian, 0.0)) {
    result.status = Status::degenerate;
    return result;
  }
  result.T_world_cam = state.T_map_cam;
  result.converged = state.converged;
  write_covariance(sums, state.T_map_cam.translation, result.covariance);
  return result;
}

}  // namespace stillmap
