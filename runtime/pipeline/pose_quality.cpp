#include "runtime/pipeline/pose_quality.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

constexpr float kSure = 0.9f;  ///< below, a pose that is not otherwise doubted is poor

/// Share of inliers as a probability: 0 at the lost threshold, 1 at twice the poor one.
float trust_in(float inlier_ratio, const TrackParams& p) {
  const float full = std::min(1.0f, 2.0f * p.poor_inlier_ratio);
  return std::clamp((inlier_ratio - p.lost_inlier_ratio) / std::max(full - p.lost_inlier_ratio, 1e-3f), 0.0f,
                    1.0f);
}

bool jumped(const Se3& from, const Se3& to, const TrackParams& p) {
  return norm(to.translation - from.translation) > p.prior_reach_m ||
         norm(log_rotation(to.rotation * transposed(from.rotation))) > p.prior_reach_rad;
}

}  // namespace

const char* to_string(TrackingState state) {
  switch (state) {
    case TrackingState::good:
      return "good";
    case TrackingState::poor:
      return "poor";
    case TrackingState::lost:
      return "lost";
  }
  return "unknown";
}

std::array<float, 6> sigma_about(const float (&covariance)[21], Vec3 centre) {
  double c[6][6];
  for (int row = 0, i = 0; row < 6; ++row)
    for (int col = row; col < 6; ++col, ++i) c[row][col] = c[col][row] = static_cast<double>(covariance[i]);
  // v_centre = v_origin - centre x w
  const double x = static_cast<double>(centre.x), y = static_cast<double>(centre.y),
               z = static_cast<double>(centre.z);
  const double shift[3][6] = {{1, 0, 0, 0, z, -y}, {0, 1, 0, -z, 0, x}, {0, 0, 1, y, -x, 0}};
  std::array<float, 6> sigma;
  for (size_t axis = 0; axis < 3; ++axis) {
    double variance = 0;
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) variance += shift[axis][i] * c[i][j] * shift[axis][j];
    sigma[axis] = static_cast<float>(std::sqrt(std::max(variance, 0.0)));
    sigma[axis + 3] = static_cast<float>(std::sqrt(std::max(c[axis + 3][axis + 3], 0.0)));
  }
  return sigma;
}

float probability_within(const std::array<float, 6>& sigma) {
  const auto inside = [](float limit, float x, float y, float z) {
    return std::erf(limit / std::sqrt(2.0f * (x * x + y * y + z * z)));
  };
  constexpr float kRadPerDeg = 0.017453293f;
  return inside(kGoodPoseM, sigma[0], sigma[1], sigma[2]) *
         inside(kGoodPoseDeg * kRadPerDeg, sigma[3], sigma[4], sigma[5]);
}

PoseQuality quality_of(const TrackResult& track, const Se3& expected, const TrackParams& params) {
  if (track.status != Status::ok || track.inlier_ratio < params.lost_inlier_ratio)
    return {TrackingState::lost, 0};
  const float bound = probability_within(sigma_about(track.covariance, track.T_world_cam.translation));
  const float p_good = bound * trust_in(track.inlier_ratio, params);
  const bool poor = track.inlier_ratio < params.poor_inlier_ratio || bound < kSure ||
                    jumped(expected, track.T_world_cam, params);
  return {poor ? TrackingState::poor : TrackingState::good, p_good};
}

PoseQuality quality_of_prediction(const std::array<float, 6>& sigma) {
  const float p_good = probability_within(sigma);
  return {p_good >= kSure ? TrackingState::poor : TrackingState::lost, p_good};
}

}  // namespace stillmap
