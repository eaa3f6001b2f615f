#pragma once

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/track/sdf_residual.hpp"

namespace stillmap {

/// A row pixel on its way into the map.
struct PixelPoint {
  Vec3 arm;             ///< camera centre to point, metres, map axes
  Vec3 grid;            ///< position in voxels, map frame
  bool usable = false;  ///< measured, in range, not masked
};

/// One pass of E_d + w_c E_c (paper Eq. (4)) over an image.
///
/// The increment turns about the camera centre: p' = c + v + exp(w) (p - c). Far from the map's origin this
/// keeps translation and rotation apart, which single precision needs.
struct TrackPass {
  VolumeView map;
  ImageView<const float> depth_m;
  ImageView<const LumaChroma> colour;
  ImageView<const uint8_t> mask;  ///< 0: static
  bool use_mask = false;          ///< false: the first registration, all pixels
  Intrinsics k;
  Se3 T_map_cam;
  float max_m = 0;
  TrackWeights weights;

  STILLMAP_HD PixelPoint point_of(int32_t row, int32_t col) const {
    PixelPoint p;
    const float z_m = depth_m.at(row, col);
    const bool masked = use_mask & (mask.at(row, col) != 0);
    p.usable = (z_m > 0.0f) & (z_m <= max_m) & !masked;
    p.arm = T_map_cam.rotation * unproject(k, static_cast<float>(col), static_cast<float>(row), z_m);
    p.grid = weights.inv_voxel_m * (p.arm + T_map_cam.translation);
    return p;
  }

  /// Fetches the voxels around a usable point.
  /// @return false when one was never observed
  STILLMAP_HD bool fetch(const PixelPoint& p, int32_t row, int32_t col, BlockCache& cache,
                         TrackPoint& out) const {
    if (!read_corners(map, p.grid, cache, out.voxel, out.fraction)) return false;
    out.arm = p.arm;
    out.luma = static_cast<float>(colour.at(row, col).luma) * (1.0f / kLumaScale);
    return true;
  }

  /// All of it for one pixel; the plain form that the vector loops of the CPU are checked against.
  STILLMAP_HD void operator()(int32_t row, int32_t col, BlockCache& cache, NormalEqT<float>& sums) const {
    const PixelPoint p = point_of(row, col);
    if (!p.usable) return;
    sums.sum[kConsidered] += 1.0f;
    TrackPoint point;
    if (fetch(p, row, col, cache, point))
      add_point(point_terms(point, weights), point.arm, 1.0f, sums.sum, 1);
  }
};

}  // namespace stillmap
