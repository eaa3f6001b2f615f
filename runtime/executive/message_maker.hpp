#pragma once

#include <array>
#include <cstdint>

#include "config/config.hpp"
#include "runtime/core/clock.hpp"
#include "runtime/executive/counters.hpp"
#include "runtime/executive/run_item.hpp"
#include "runtime/ports/messages.hpp"
#include "runtime/ports/range_sensor.hpp"

namespace stillmap {

/// The same motion, seen from other axes: covariance of a left perturbation (x y z rx ry rz) of a pose in
/// `from`, as one in `to`. Upper triangles row by row.
void transform_covariance(const Se3d& T_to_from, const float (&from)[21], float (&to)[21]);

/// Results as messages: poses of the camera in the map become poses of the body in local, stamps become UTC,
/// and velocities come from one pose to the next.                             test: message_maker_test
/// @thread one; does not allocate
class MessageMaker {
 public:
  /// @param clock, state outlive this  @param T_map_cam of the first frame: where the body is then, is the
  /// origin of local, level but for mount.initial_rp_deg
  MessageMaker(const Config& config, const UtcClock& clock, const RunState& state, const Se3d& T_map_cam);

  PoseMessage pose(const PublishItem& item);
  /// @param pose_age_ms of this frame's pose when it was handed to the bus; 0: none was
  StatusMessage status(const PublishItem& item, float pose_age_ms);
  RangeMessage range(const RangeReading& reading) const;
  /// Between frames: what is known without one.
  StatusMessage status_without_frame() const;

 private:
  void fill_counters(StatusMessage& message) const;

  const UtcClock& clock_;
  const RunState& state_;
  const Se3d T_cam_body_, T_local_map_;
  const float max_range_m_;
  Se3d T_local_body_before_;
  Stamp captured_before_;
  uint32_t epoch_before_ = 0;
  bool have_before_ = false;
  Stamp last_frame_;     ///< captured, of the last status
  double period_s_ = 0;  ///< mean, between processed frames
  StatusMessage last_;
};

}  // namespace stillmap
