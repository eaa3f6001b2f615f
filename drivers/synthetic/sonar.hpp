#pragma once

// The near-range sonar on top of the synthetic camera: mounted as SonarConfig's defaults say.

#include "drivers/synthetic/renderer.hpp"

namespace stillmap::synthetic {

inline constexpr float kSonarStepM = 0.003f;  ///< resolution of the reading

/// Distance from the sonar to the nearest thing in its cone, metres; 0: nothing in its range.
/// @param images as the camera at `k` sees them, without noise and however near            test: scenes_test
float sonar_reading_m(const IdealImages& images, const Intrinsics& k);

}  // namespace stillmap::synthetic
