#include "runtime/pipeline/motion_predictor.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

using Axes = std::array<double, 6>;

Axes axes_of(const Twistd& t) {
  return {t.v.x, t.v.y, t.v.z, t.w.x, t.w.y, t.w.z};
}
Twistd twist_of(const Axes& a) {
  return {{a[0], a[1], a[2]}, {a[3], a[4], a[5]}};
}

double seconds_between(Stamp from, Stamp to) {
  return static_cast<double>(to.ns - from.ns) * 1e-9;
}

Stamp shifted(Stamp stamp, float by_ms) {
  return {stamp.ns + static_cast<int64_t>(std::llround(static_cast<double>(by_ms) * 1e6))};
}

Se3d pose_of(const std::array<float, 7>& p) {
  const auto d = [&](size_t i) { return static_cast<double>(p[i]); };
  return {rotation_from(Quatd{d(3), d(4), d(5), d(6)}), {d(0), d(1), d(2)}};
}

/// Value of the place axes or of the direction axes.
double of_axis(size_t axis, float metres, float radians) {
  return static_cast<double>(axis < 3 ? metres : radians);
}

/// R diag(1 / sigma^2) R^T
void add_information(const Mat3T<double>& r, const float* sigma, Mat3T<double>& sum) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      sum.m[3 * i + j] = 0;
      for (int k = 0; k < 3; ++k) {
        const double s = static_cast<double>(sigma[k]);
        sum.m[3 * i + j] += r(i, k) * r(j, k) / (s * s);
      }
    }
}

}  // namespace

void information_in_map_axes(const PredictedPose& predicted, double information[21]) {
  Mat3T<double> place, direction;
  add_information(predicted.T_map_cam.rotation, predicted.sigma.data(), place);
  add_information(predicted.T_map_cam.rotation, predicted.sigma.data() + 3, direction);
  int k = 0;
  for (int r = 0; r < 6; ++r)
    for (int c = r; c < 6; ++c)
      information[k++] = c < 3 ? place(r, c) : r >= 3 ? direction(r - 3, c - 3) : 0.0;
}

MotionPredictor::MotionPredictor(const Config& config, const Se3d& T_map_cam, OdometryPort* odometry)
    : track_(config.track),
      odometry_config_(config.odometry),
      T_body_cam_(pose_of(config.mount.T_body_cam)),
      odometry_(config.track.prior == MotionPrior::odometry ? odometry : nullptr),
      T_map_cam_(T_map_cam) {}

/// A worse error counts at once, a better one slowly.
void MotionPredictor::Trust::learn(const Axes& error_per_s, double forget) {
  constexpr double kWorse = 0.5;
  for (size_t i = 0; i < 6; ++i) {
    const double square = error_per_s[i] * error_per_s[i];
    const double share = !known ? 1.0 : square > variance[i] ? std::max(kWorse, forget) : forget;
    variance[i] += share * (square - variance[i]);
  }
  known = true;
}

/// What is left of a velocity's way after `ahead_s`.
double MotionPredictor::fade(double ahead_s) const {
  return std::exp(-ahead_s / static_cast<double>(track_.prior_fade_s));
}

MotionPredictor::Motion MotionPredictor::by_velocity(double ahead_s) const {
  Motion motion;
  Axes way;
  for (size_t i = 0; i < 6; ++i) {
    const double reach = of_axis(i, track_.prior_reach_m, track_.prior_reach_rad);
    const double full = velocity_[i] * ahead_s;
    way[i] = std::clamp(fade(ahead_s) * full, -reach, reach);
    motion.sigma[i] = std::abs(full - way[i]);  // it may have gone on all the same
  }
  motion.T_last_next = exp(twist_of(way));
  return motion;
}

/// Nothing when the odometry does not reach back to `from`, or not near enough to `to`.
std::optional<MotionPredictor::Motion> MotionPredictor::by_odometry(Stamp from, Stamp to) const {
  if (!odometry_ || !(from < to)) return std::nullopt;
  const float offset_ms = odometry_config_.time_offset_ms;
  OdometrySample a, b;
  if (odometry_->at(shifted(from, -offset_ms), a) != Status::ok) return std::nullopt;
  if (odometry_->at(shifted(to, -offset_ms), b) != Status::ok) return std::nullopt;
  a.stamp = shifted(a.stamp, offset_ms);
  b.stamp = shifted(b.stamp, offset_ms);
  const double age_s = seconds_between(b.stamp, to);
  if (age_s > 1e-3 * static_cast<double>(odometry_config_.max_age_ms) || a.stamp < from ||
      !(a.stamp < b.stamp))
    return std::nullopt;

  const Se3d body_motion = inverse(a.T_odom_body) * b.T_odom_body;
  const double way_m = norm(body_motion.translation), turn_rad = norm(log_rotation(body_motion.rotation));
  const Motion rest = by_velocity(age_s);
  Motion motion;
  motion.T_last_next = inverse(T_body_cam_) * body_motion * T_body_cam_ * rest.T_last_next;
  const OdometryConfig& o = odometry_config_;
  for (size_t i = 0; i < 6; ++i)
    motion.sigma[i] = (i < 3 ? static_cast<double>(o.sigma_m_per_m) * way_m
                             : static_cast<double>(o.sigma_rad_per_rad) * turn_rad +
                                   static_cast<double>(o.sigma_rad_per_m) * way_m);
  return motion;
}

PredictedPose MotionPredictor::predicted(const Motion& motion, const Trust& trust, double ahead_s,
                                         MotionPrior from) const {
  PredictedPose out;
  out.T_map_cam = T_map_cam_ * motion.T_last_next;
  out.from = from;
  // Over a gap a velocity errs more than in proportion to the time: what was learnt, was learnt from frame to
  // frame. Odometry goes on to measure.
  const double growth = from == MotionPrior::odometry ? 1.0 : 1.0 / fade(ahead_s);
  for (size_t i = 0; i < 6; ++i) {
    const double reach = of_axis(i, track_.prior_reach_m, track_.prior_reach_rad);
    const double floor = of_axis(i, track_.prior_floor_m, track_.prior_floor_rad);
    const double learnt = std::max(std::sqrt(trust.variance[i]) * ahead_s, floor) * growth;
    const double sigma = trust.known ? std::max(learnt, motion.sigma[i]) : reach;
    out.sigma[i] = static_cast<float>(std::clamp(sigma, floor, std::max(reach, floor)));
  }
  return out;
}

PredictedPose MotionPredictor::predict(Stamp stamp) {
  const double ahead_s = seconds_between(stamp_, stamp);
  if (!started_ || ahead_s <= 0) return predicted({}, {}, 0, MotionPrior::last_pose);
  if (const auto motion = by_odometry(stamp_, stamp))
    return predicted(*motion, odometry_trust_, ahead_s, MotionPrior::odometry);
  const Motion motion = by_velocity(ahead_s);
  if (track_.prior != MotionPrior::last_pose)
    return predicted(motion, velocity_trust_, ahead_s, MotionPrior::constant_velocity);
  return predicted({}, velocity_trust_, ahead_s, MotionPrior::last_pose);
}

void MotionPredictor::update(Stamp stamp, const Se3d& T_map_cam) {
  const double passed_s = seconds_between(stamp_, stamp);
  // After a long gap the way between two poses says little about the motion now.
  constexpr double kLongestGap = 3.0;  // of the time constant of fading
  if (!started_ || passed_s <= 0 || passed_s > kLongestGap * static_cast<double>(track_.prior_fade_s))
    return restart(stamp, T_map_cam);
  const auto error_of = [&](const Motion& motion) {
    Axes error = axes_of(log(inverse(T_map_cam_ * motion.T_last_next) * T_map_cam));
    for (double& e : error) e /= passed_s;
    return error;
  };
  const double forget = static_cast<double>(track_.prior_forget);
  const double gain = velocity_trust_.known ? static_cast<double>(track_.prior_gain) : 1.0;
  const Motion expected = track_.prior == MotionPrior::last_pose ? Motion{} : by_velocity(passed_s);
  velocity_trust_.learn(error_of(expected), forget);
  if (const auto motion = by_odometry(stamp_, stamp)) odometry_trust_.learn(error_of(*motion), forget);

  const Axes way = axes_of(log(inverse(T_map_cam_) * T_map_cam));
  for (size_t i = 0; i < 6; ++i) velocity_[i] += gain * (way[i] / passed_s - velocity_[i]);
  T_map_cam_ = T_map_cam;
  stamp_ = stamp;
}

void MotionPredictor::restart(Stamp stamp, const Se3d& T_map_cam) {
  T_map_cam_ = T_map_cam;
  stamp_ = stamp;
  started_ = true;
  velocity_ = {};
  velocity_trust_ = odometry_trust_ = {};
}

}  // namespace stillmap
