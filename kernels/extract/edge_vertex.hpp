#pragma once

#include "kernels/extract/surface_rule.hpp"
#include "kernels/map/block_key.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

/// Where the distance is 0 between two voxels, as a share of the way from the first to the second. Kept off
/// the ends, so that no triangle collapses.                                         test: edge_vertex_test
/// @param from,to signed distances of different sign, same unit
STILLMAP_HD float crossing(int16_t from, int16_t to) {
  const float a = static_cast<float>(from), b = static_cast<float>(to);
  const float t = a / (a - b);
  return t < 0.001f ? 0.001f : t > 0.999f ? 0.999f : t;
}

/// Colour between two voxels; of the one that has colour when the other has none.   test: edge_vertex_test
STILLMAP_HD Rgb8 colour_between(VoxelSurface s0, VoxelRecord r0, VoxelSurface s1, VoxelRecord r1, float t) {
  if (r0.colour_weight == 0 && r1.colour_weight == 0) return kUncoloured;
  if (r0.colour_weight == 0) t = 1.0f;
  if (r1.colour_weight == 0) t = 0.0f;
  const auto mix = [t](int32_t a, int32_t b) {
    return static_cast<float>(a) + t * static_cast<float>(b - a);
  };
  return colour_from(mix(s0.luma, s1.luma) * (1.0f / kLumaScale), mix(r0.cb, r1.cb), mix(r0.cr, r1.cr));
}

}  // namespace stillmap
