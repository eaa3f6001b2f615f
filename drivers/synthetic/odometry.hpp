#pragma once

// What wheels and a gyroscope would say of the way of the body that carries the camera.

#include <cstdint>

#include "drivers/synthetic/scene.hpp"
#include "runtime/ports/odometry_ring.hpp"

namespace stillmap::synthetic {

inline constexpr double kOdometryRateHz = 50.0;
inline constexpr double kOdometryScale = 0.02;        ///< the scale of the way stays within 1 -+ this, slowly
inline constexpr double kOdometryTurnScale = 0.01;    ///< of turns
inline constexpr double kOdometryNoise = 0.02;        ///< m after a metre, growing with its square root
inline constexpr double kOdometryTurnNoiseDeg = 0.3;  ///< degrees after a metre, likewise
inline constexpr double kOdometryRestNoiseM = 2e-5;   ///< of each sample, also at rest
inline constexpr double kSlipEveryS = 4.0, kSlipS = 0.5;  ///< how often and how long wheels slip
inline constexpr double kSlipMPerS = 0.4;                 ///< forward motion that is told meanwhile

/// Measured way of a body in whose frame (x forward, y left, z up) the camera sits level and looks forward.
/// The scenes' cameras are held by hand, so the body moves in all six directions and its way is measured in
/// all of them, each with an error that grows with the way gone. A pure function of scene and seed as long as
/// it is asked from the start on.
/// @thread one at a time
class WheelOdometry final : public OdometryPort {
 public:
  WheelOdometry(const Scene& scene, uint64_t seed, bool slips);

  /// Knows nothing that is later than the latest stamp that it was asked for.
  Status at(Stamp stamp, OdometrySample& sample) override;

 private:
  Se3d true_body(int64_t index) const;
  void add_sample();
  double noise(uint32_t field) const;

  const Scene& scene_;
  uint64_t seed_;
  bool slips_;
  int64_t next_ = 0;  ///< index of the sample to come
  Se3d T_world_body_, T_odom_body_;
  OdometryRing ring_;
};

}  // namespace stillmap::synthetic
