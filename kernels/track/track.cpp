#include "kernels/track/track.hpp"

#include <cmath>

namespace stillmap {
namespace {

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
  PoseSearch search;
  search.start(T_start, params);
  for (int32_t level = levels.coarsest; level >= levels.finest; --level) {
    search.start_level(1 << level, iterations_at(params, level));
    while (!search.level_done) search.take(pass(search.T_try, search.step_px), prior, params);
  }
  return result_of(search, T_start, levels.finest, min_points);
}

TrackResult result_of(const PoseSearch& search, const Se3& T_start, int32_t finest_level,
                      int32_t min_points) {
  TrackResult result;
  result.T_world_cam = T_start;
  result.iterations = search.iterations;
  const NormalEq& sums = search.sums;
  result.mapped_ratio =
      static_cast<float>(sums.sum[kConsidered] > 0 ? sums.sum[kPoints] / sums.sum[kConsidered] : 0);
  result.inlier_ratio =
      static_cast<float>(sums.sum[kPoints] > 0 ? sums.sum[kInliers] / sums.sum[kPoints] : 0);
  result.rmse_m =
      static_cast<float>(sums.sum[kInliers] > 0 ? std::sqrt(sums.sum[kSumSdf2] / sums.sum[kInliers]) : 0);
  Cholesky6 cholesky;
  if (sums.sum[kPoints] * (1 << 2 * finest_level) < min_points ||
      !cholesky.factor(sums.sum + kHessian, 0.0)) {
    result.status = Status::degenerate;
    return result;
  }
  result.T_world_cam = search.T_map_cam;
  result.converged = search.converged;
  write_covariance(sums, search.T_map_cam.translation, result.covariance);
  return result;
}

}  // namespace stillmap
