#pragma once

#include <cstdint>

#include "kernels/map/voxel.hpp"

namespace stillmap {

/// From here on a distance only says "far". Where such a voxel meets one of the other sign there is no
/// surface but the rim of what was seen: free space beside the unseen inside of an object (ours).
constexpr int16_t kFarSdf = static_cast<int16_t>(kSdfMax / 10 * 9);

STILLMAP_HD bool is_far(int16_t sdf) {
  return sdf >= kFarSdf || sdf <= -kFarSdf;
}

/// Colour of a surface that was never seen in colour.
constexpr Rgb8 kUncoloured = {128, 128, 128};

}  // namespace stillmap
