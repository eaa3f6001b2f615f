#pragma once

// Materials that more than one building has.

#include "drivers/synthetic/scene.hpp"

namespace stillmap::synthetic {

inline Material wood(uint32_t variant) {
  return {Pattern::planks, {96, 62, 38}, {176, 128, 84}, 0.12f, variant};
}

inline Material print(Vec3 ground, float tile_m, uint32_t variant) {
  return {Pattern::poster, ground, {235, 230, 210}, tile_m, variant};
}

inline Material wallpaper(uint32_t variant) {
  const Vec3 tints[4] = {{206, 190, 160}, {170, 190, 176}, {176, 182, 206}, {204, 176, 170}};
  const Vec3 ground = tints[variant % 4];
  return {Pattern::wallpaper, ground, 0.78f * ground, 0.13f + 0.02f * static_cast<float>(variant % 3),
          variant};
}

}  // namespace stillmap::synthetic
