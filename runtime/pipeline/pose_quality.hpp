#pragma once

// How far a pose can be believed: good, poor or lost, and with which probability.

#include <array>
#include <cstdint>

#include "config/config.hpp"
#include "kernels/engine.hpp"

namespace stillmap {

enum class TrackingState : uint8_t { good, poor, lost };
const char* to_string(TrackingState state);

/// A good pose lies within these of the truth.
inline constexpr float kGoodPoseM = 0.05f, kGoodPoseDeg = 3.0f;

struct PoseQuality {
  TrackingState state = TrackingState::lost;
  float p_good = 0;  ///< probability that the pose is good, 0..1
};

/// Standard deviations of x y z rx ry rz about the camera's centre, metres and radians, map axes.
/// @param covariance as in TrackResult: about the map's origin; @param centre of the camera, map frame
std::array<float, 6> sigma_about(const float (&covariance)[21], Vec3 centre);

/// Probability that a pose with these errors is a good one. Errors of all axes are taken to add up.
float probability_within(const std::array<float, 6>& sigma);

/// Of a registration. Three things speak against it: few points near the map (lost, poor), a direction that
/// neither the points nor the prior hold (poor, by the covariance), a step beyond the prediction's reach
/// (track.prior_reach_*; poor).
/// @param expected the prediction that it started from                 test: pose_quality_test
PoseQuality quality_of(const TrackResult& track, const Se3& expected, const TrackParams& params);

/// Of a pose that was predicted alone: poor while it is sure enough, then lost.
PoseQuality quality_of_prediction(const std::array<float, 6>& sigma);

}  // namespace stillmap
