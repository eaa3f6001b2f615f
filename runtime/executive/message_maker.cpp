#include "runtime/executive/message_maker.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace stillmap {
namespace {

Se3d pose_of(const std::array<float, 7>& v) {
  return {rotation_from(QuatT<double>{static_cast<double>(v[3]), static_cast<double>(v[4]),
                                      static_cast<double>(v[5]), static_cast<double>(v[6])}),
          {static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])}};
}

/// The first body pose in local: at the origin, heading along x, tilted as the mount says.
Se3d first_body_pose(const std::array<float, 2>& rp_deg) {
  constexpr double kRad = std::numbers::pi / 180;
  const Vec3d roll{static_cast<double>(rp_deg[0]) * kRad, 0, 0};
  const Vec3d pitch{0, static_cast<double>(rp_deg[1]) * kRad, 0};
  return exp(Twistd{{}, pitch}) * exp(Twistd{{}, roll});
}

void put(double (&to)[3], const Vec3d& v) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

}  // namespace

void transform_covariance(const Se3d& T_to_from, const float (&from)[21], float (&to)[21]) {
  // Adjoint: v' = R v + t x (R w), w' = R w.
  const Mat3T<double>& r = T_to_from.rotation;
  const Vec3d& t = T_to_from.translation;
  const double skew[3][3] = {{0, -t.z, t.y}, {t.z, 0, -t.x}, {-t.y, t.x, 0}};
  double adjoint[6][6] = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      adjoint[i][j] = adjoint[i + 3][j + 3] = r(i, j);
      for (int k = 0; k < 3; ++k) adjoint[i][j + 3] += skew[i][k] * r(k, j);
    }
  double full[6][6], left[6][6] = {};
  for (int i = 0, n = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j, ++n) full[i][j] = full[j][i] = static_cast<double>(from[n]);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      for (int k = 0; k < 6; ++k) left[i][j] += adjoint[i][k] * full[k][j];
  for (int i = 0, n = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j, ++n) {
      double sum = 0;
      for (int k = 0; k < 6; ++k) sum += left[i][k] * adjoint[j][k];
      to[n] = static_cast<float>(sum);
    }
}

MessageMaker::MessageMaker(const Config& config, const UtcClock& clock, const RunState& state,
                           const Se3d& T_map_cam)
    : clock_(clock),
      state_(state),
      T_cam_body_(inverse(pose_of(config.mount.T_body_cam))),
      T_local_map_(first_body_pose(config.mount.initial_rp_deg) * inverse(T_map_cam * T_cam_body_)),
      max_range_m_(config.sonar.max_m) {}

PoseMessage MessageMaker::pose(const PublishItem& item) {
  const FrameResult& r = item.result;
  const Se3d T_local_body = T_local_map_ * r.T_map_cam * T_cam_body_;
  PoseMessage message;
  message.utime.us = clock_.to_utc_us(r.captured.ns);
  put(message.pos_m, T_local_body.translation);
  const auto q = quaternion_from(T_local_body.rotation);
  message.orientation_wxyz[0] = q.w;
  message.orientation_wxyz[1] = q.x;
  message.orientation_wxyz[2] = q.y;
  message.orientation_wxyz[3] = q.z;
  for (double& a : message.accel_m_s2) a = std::numeric_limits<double>::quiet_NaN();
  const double dt_s = static_cast<double>(r.captured.ns - captured_before_.ns) * 1e-9;
  constexpr double kLongest_s = 1.0;  // after a longer gap the mean motion says little
  if (have_before_ && item.pose_epoch == epoch_before_ && dt_s > 0 && dt_s < kLongest_s) {
    put(message.vel_m_s, (1 / dt_s) * (T_local_body.translation - T_local_body_before_.translation));
    put(message.rotation_rate_rad_s,
        (1 / dt_s) * log_rotation(transposed(T_local_body_before_.rotation) * T_local_body.rotation));
  }
  T_local_body_before_ = T_local_body;
  captured_before_ = r.captured;
  epoch_before_ = item.pose_epoch;
  have_before_ = true;
  return message;
}

RangeMessage MessageMaker::range(const RangeReading& reading) const {
  return {{clock_.to_utc_us(reading.stamp.ns)}, reading.range_m, max_range_m_, reading.valid, reading.stop};
}

StatusMessage MessageMaker::status(const PublishItem& item, float pose_age_ms) {
  const FrameResult& r = item.result;
  StatusMessage m;
  m.utime.us = clock_.to_utc_us(r.captured.ns);
  m.frame = r.sequence;
  m.state = static_cast<uint8_t>(r.state);
  transform_covariance(T_local_map_, r.covariance, m.covariance);
  m.p_good = r.p_good;
  m.inlier_ratio = r.inlier_ratio;
  m.masked_fraction = r.masked_fraction;
  m.prepare_ms = r.ms.prepare_ms;
  m.track_ms = r.ms.track_ms;
  m.mask_ms = r.ms.mask_ms;
  m.refine_ms = r.ms.refine_ms;
  m.integrate_ms = r.ms.integrate_ms;
  m.total_ms = r.ms.total_ms;
  m.pose_age_ms = pose_age_ms;
  m.map_fill = r.map.fill;
  m.map_blocks = r.map.blocks;
  constexpr double kGain = 0.1;
  const double step_s = static_cast<double>(r.captured.ns - last_frame_.ns) * 1e-9;
  if (last_frame_.ns > 0 && step_s > 0) period_s_ += (period_s_ > 0 ? kGain : 1.0) * (step_s - period_s_);
  last_frame_ = r.captured;
  m.rate_hz = period_s_ > 0 ? static_cast<float>(1 / period_s_) : 0.0f;
  m.pose_epoch = item.pose_epoch;
  m.map_id = item.map_id;
  fill_counters(m);
  last_ = m;
  return m;
}

StatusMessage MessageMaker::status_without_frame() const {
  StatusMessage m = last_;
  m.utime.us = clock_.to_utc_us(monotonic_ns());
  fill_counters(m);
  return m;
}

void MessageMaker::fill_counters(StatusMessage& m) const {
  const auto relaxed = std::memory_order_relaxed;
  m.mode = static_cast<Mode>(state_.mode.load(relaxed));
  m.shed = static_cast<Shed>(state_.shed.load(relaxed));
  m.frames_dropped = state_.frames_dropped.load(relaxed);
  m.results_dropped = state_.results_dropped.load(relaxed);
  m.deadline_misses = state_.deadline_misses.load(relaxed);
  m.faults_latched = state_.faults.latched();
  m.faults_active = state_.faults.active();
  for (uint32_t i = 0; i < kFaults; ++i) m.fault_count[i] = state_.faults.entry(static_cast<Fault>(i)).count;
  m.command_id = state_.command_id.load(relaxed);
  m.command_result = static_cast<CommandResult>(state_.command_result.load(relaxed));
}

}  // namespace stillmap
