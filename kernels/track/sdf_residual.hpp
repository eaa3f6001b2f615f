#pragma once

#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Distance and intensity of the map at one point, with gradients, from the same eight voxels.
struct PointSample {
  float sdf_m = 0;
  Vec3 sdf_gradient;  ///< d sdf / d p, 1
  bool has_surface =
      false;  ///< none of the voxels is at the truncation distance: gradients and intensity mean something
  float luma = 0;      ///< 0..1
  Vec3 luma_gradient;  ///< 1/m
};

/// V_SDF, V_I and their gradients at a point (paper section III-B, Eq. (2) and (3)).    test: track_test
/// @param p_map metres, map frame
/// @return false when a neighbouring voxel is unobserved; `out` is then untouched
/// @thread any (pure)
STILLMAP_HD bool sample_point(const VolumeView& map, Vec3 p_map, BlockCache& cache, PointSample& out) {
  Corners corners;
  if (!read_corners(map, p_map, cache, corners)) return false;
  float sdf[8], luma[8];
  bool surface = true;
  for (int i = 0; i < 8; ++i) {
    sdf[i] = static_cast<float>(corners.voxel[i].sdf);
    luma[i] = static_cast<float>(corners.voxel[i].luma);
    surface &= corners.voxel[i].sdf != kSdfMax;
  }
  const float unit_m = map.sdf_unit_m();
  out.sdf_m = trilinear(sdf, corners.fraction) * unit_m;
  out.has_surface = surface;
  if (!surface) return true;
  out.sdf_gradient = (unit_m / map.voxel_m) * trilinear_gradient(sdf, corners.fraction);
  out.luma = trilinear(luma, corners.fraction) * (1.0f / kLumaScale);
  out.luma_gradient = (1.0f / (kLumaScale * map.voxel_m)) * trilinear_gradient(luma, corners.fraction);
  return true;
}

}  // namespace stillmap
