#pragma once

// Where the camera will be in the next frame, and how sure that is: constant velocity or odometry.

#include <array>
#include <optional>

#include "config/config.hpp"
#include "runtime/ports/odometry.hpp"

namespace stillmap {

/// A pose that was expected before the image was looked at.
struct PredictedPose {
  Se3d T_map_cam;
  /// Standard deviations of x y z rx ry rz, metres and radians, about the camera's centre along the camera's
  /// axes (x right, y down, z forward): true pose = T_map_cam * exp(error).
  std::array<float, 6> sigma = {};
  MotionPrior from = MotionPrior::last_pose;  ///< what it was made of
};

/// Inverse covariance of a prediction for a twist (v, w) in the map's axes about the camera's centre c,
/// p' = c + v + exp(w) (p - c): order x y z rx ry rz, upper triangle row by row, 1/m^2 and 1/rad^2. Place and
/// direction are independent.
void information_in_map_axes(const PredictedPose& predicted, double information[21]);

/// Follows the poses of the tracker. Each axis of the camera's motion has a velocity, smoothed and faded, and
/// an error that it learns from how well the last predictions came true: small in steady motion, large at
/// once when the motion changes. Odometry, where asked for and fresh, replaces the velocity and has errors
/// learnt in the same way, so that wheels that slip lose their weight.
/// @thread one at a time; nothing allocates
class MotionPredictor {
 public:
  /// @param T_map_cam pose before the first frame
  /// @param odometry may be null; outlives this
  MotionPredictor(const Config& config, const Se3d& T_map_cam, OdometryPort* odometry = nullptr);

  /// For a frame at `stamp`. A gap (lost frames are one) pulls the prediction towards the last pose and
  /// widens sigma; a stamp that is not later than the last one gives the last pose at the widest sigma.
  PredictedPose predict(Stamp stamp);

  /// The tracker found this pose.
  void update(Stamp stamp, const Se3d& T_map_cam);

  /// This is where the camera is, and how it got there says nothing about its motion: start, relocalisation.
  void restart(Stamp stamp, const Se3d& T_map_cam);

  const Se3d& last_pose() const { return T_map_cam_; }

 private:
  using Axes = std::array<double, 6>;

  /// Errors of one kind of prediction, learnt for each axis.
  struct Trust {
    Axes variance = {};  ///< (m/s)^2, (rad/s)^2
    bool known = false;
    void learn(const Axes& error_per_s, double forget);
  };

  struct Motion {
    Se3d T_last_next;
    Axes sigma = {};  ///< beyond what Trust knows
  };

  Motion by_velocity(double ahead_s) const;
  std::optional<Motion> by_odometry(Stamp from, Stamp to) const;
  PredictedPose predicted(const Motion& motion, const Trust& trust, double ahead_s, MotionPrior from) const;
  double fade(double ahead_s) const;

  TrackParams track_;
  OdometryConfig odometry_config_;
  Se3d T_body_cam_;
  OdometryPort* odometry_;

  Se3d T_map_cam_;  ///< last pose
  Stamp stamp_;
  bool started_ = false;
  Axes velocity_ = {};  ///< camera's axes, m/s, rad/s
  Trust velocity_trust_, odometry_trust_;
};

}  // namespace stillmap
