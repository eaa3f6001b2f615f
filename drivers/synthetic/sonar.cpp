#include "drivers/synthetic/sonar.hpp"

#include <cmath>

#include "config/config.hpp"

namespace stillmap::synthetic {

float sonar_reading_m(const IdealImages& images, const Intrinsics& k) {
  const SonarConfig sonar;  // looks along the optical axis
  constexpr float kHalfDegree = 3.14159265f / 360.0f;
  const Vec3 place_cam = {sonar.T_cam_sonar[0], sonar.T_cam_sonar[1], sonar.T_cam_sonar[2]};
  const float cos_half_beam = std::cos(kHalfDegree * sonar.beam_deg);
  float nearest_m = sonar.max_m;
  for (int32_t row = 0; row < k.height; ++row)
    for (int32_t col = 0; col < k.width; ++col) {
      const float z_m = images.depth_m[static_cast<size_t>(row * k.width + col)];
      const Vec3 from_sonar = unproject(k, static_cast<float>(col), static_cast<float>(row), z_m) - place_cam;
      const float distance_m = norm(from_sonar);
      if (distance_m < nearest_m && from_sonar.z >= cos_half_beam * distance_m) nearest_m = distance_m;
    }
  if (nearest_m >= sonar.max_m || nearest_m < sonar.min_m) return 0.0f;
  return kSonarStepM * std::round(nearest_m / kSonarStepM);
}

}  // namespace stillmap::synthetic
