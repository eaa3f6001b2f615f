#include "runtime/evaluate/pose_score.hpp"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "runtime/evaluate/statistics.hpp"

namespace stillmap {
namespace {

constexpr double kDegPerRad = 57.29577951308232;

/// Mean of transformations that lie near to each other.
Se3d mean_of(const std::array<Se3d, kMapWindow>& transforms) {
  const Se3d T_reference_0 = inverse(transforms[0]);
  Twistd sum;
  for (const Se3d& T : transforms) {
    const Twistd from_first = log(T * T_reference_0);
    sum = {sum.v + from_first.v, sum.w + from_first.w};
  }
  const double share = 1.0 / static_cast<double>(kMapWindow);
  return exp(Twistd{share * sum.v, share * sum.w}) * transforms[0];
}

}  // namespace

double chi_square(const Twistd& x, const float (&covariance)[21]) {
  Eigen::Matrix<double, 6, 6> C;
  for (int row = 0, i = 0; row < 6; ++row)
    for (int col = row; col < 6; ++col, ++i) C(row, col) = C(col, row) = static_cast<double>(covariance[i]);
  const Eigen::LLT<Eigen::Matrix<double, 6, 6>> factors(C);
  if (factors.info() != Eigen::Success) return kUnknown;
  Eigen::Matrix<double, 6, 1> v;
  v << x.v.x, x.v.y, x.v.z, x.w.x, x.w.y, x.w.z;
  return v.dot(factors.solve(v));
}

PoseErrors PoseScore::add(const FrameResult& result, const std::optional<Se3d>& truth_T_world_cam,
                          const StaticShares& shares) {
  PoseErrors errors{kUnknown, kUnknown, kUnknown, false};
  if (!truth_T_world_cam) return errors;
  if (!T_map_world_) {
    if (result.status != Status::ok) return errors;  // the map starts with the first frame that was used
    T_map_world_ = result.T_map_cam * inverse(*truth_T_world_cam);
  }
  const Se3d true_T_map_cam = *T_map_world_ * *truth_T_world_cam;
  errors.error_m = norm(result.T_map_cam.translation - true_T_map_cam.translation);
  errors.error_deg =
      kDegPerRad * norm(log_rotation(transposed(true_T_map_cam.rotation) * result.T_map_cam.rotation));
  errors.off = !(errors.error_m <= static_cast<double>(kGoodPoseM) &&
                 errors.error_deg <= static_cast<double>(kGoodPoseDeg));

  const bool good = result.state == TrackingState::good, lost = result.state == TrackingState::lost;
  ++counts_.frames;
  counts_.good += good;
  counts_.good_off += good && errors.off;
  counts_.undeclared_loss += !lost && errors.off;
  counts_.declared_loss += lost && shares.of_valid >= kEnoughStatic;
  counts_.in_view += shares.of_view >= kEnoughStatic;
  counts_.in_view_good += good && shares.of_view >= kEnoughStatic;
  if (last_true_position_) counts_.path_m += norm(true_T_map_cam.translation - *last_true_position_);
  last_true_position_ = true_T_map_cam.translation;
  counts_.end_error_m = errors.error_m;

  if (lost) in_window_ = next_in_window_ = 0;
  if (good && result.status == Status::ok)
    errors.chi2 = error_under_covariance(result, result.T_map_cam * inverse(true_T_map_cam));
  return errors;
}

double PoseScore::error_under_covariance(const FrameResult& result, const Se3d& E) {
  double chi2 = kUnknown;
  if (in_window_ == kMapWindow) {
    chi2 = chi_square(log(E * inverse(mean_of(window_))), result.covariance);
    ++counts_.chi2_frames;
    counts_.chi2_inside += chi2 <= kChi2Bound;  // a covariance that is none holds nothing
  }
  remember(E);
  return chi2;
}

void PoseScore::remember(const Se3d& E) {
  window_[next_in_window_] = E;
  next_in_window_ = (next_in_window_ + 1) % kMapWindow;
  if (in_window_ < kMapWindow) ++in_window_;
}

}  // namespace stillmap
