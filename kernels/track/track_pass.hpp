#pragma once

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/track/sdf_residual.hpp"

namespace stillmap {

/// A pixel on its way into the map.
template <class F>
struct PixelPoint {
  Vec3T<F> arm;        ///< camera centre to point, metres, map axes
  GridCell<F> cell;    ///< of the map
  MaskOf<F> in_range;  ///< measured, not too far
};

/// One pass of E_d + w_c E_c (paper Eq. (4)) over an image.
///
/// The increment turns about the camera centre: p' = c + v + exp(w) (p - c). Far from the map's origin this
/// keeps translation and rotation apart, which single precision needs.
struct TrackPass {
  VolumeView map;
  ImageView<const float> depth_m;
  ImageView<const LumaChroma> colour;
  ImageView<const uint8_t> trust;  ///< 255: counts in full, 0: not at all; no data: every pixel in full
  Intrinsics k;
  Se3 T_map_cam;
  float max_m = 0;
  TrackWeights weights;

  /// Eq. (1), the pose, and the cell of the map.
  template <class F>
  STILLMAP_HD PixelPoint<F> point_of(F row, F col, F z_m) const {
    PixelPoint<F> p;
    p.in_range = (z_m > F(0.0f)) & (z_m <= F(max_m));
    const F safe_z_m = select(p.in_range, z_m, F(0.0f));
    const Vec3T<F> p_cam = {(col - F(k.cx)) * F(1.0f / k.fx) * safe_z_m,
                            (row - F(k.cy)) * F(1.0f / k.fy) * safe_z_m, safe_z_m};
    const Mat3& r = T_map_cam.rotation;
    p.arm = {F(r.m[0]) * p_cam.x + F(r.m[1]) * p_cam.y + F(r.m[2]) * p_cam.z,
             F(r.m[3]) * p_cam.x + F(r.m[4]) * p_cam.y + F(r.m[5]) * p_cam.z,
             F(r.m[6]) * p_cam.x + F(r.m[7]) * p_cam.y + F(r.m[8]) * p_cam.z};
    const Vec3 t = T_map_cam.translation;
    p.cell = cell_of(F(weights.inv_voxel_m) * (p.arm + Vec3T<F>{F(t.x), F(t.y), F(t.z)}));
    return p;
  }

  STILLMAP_HD float trust01(int32_t row, int32_t col) const {
    return trust.data ? static_cast<float>(trust.at(row, col)) * (1.0f / 255.0f) : 1.0f;
  }

  /// A measurement with the voxels around it. False: out of range, or it has no value in the map.
  template <class Cache>
  STILLMAP_HD bool fetch(int32_t row, int32_t col, float z_m, float luma, Cache& cache,
                         TrackPoint<float>& point) const {
    const PixelPoint<float> p = point_of(static_cast<float>(row), static_cast<float>(col), z_m);
    if (!p.in_range) return false;
    VoxelSurface voxel[8];
    if (!read_corners(map, {p.cell.x, p.cell.y, p.cell.z}, cache, voxel)) return false;
    point.surface = true;
    for (int32_t i = 0; i < 8; ++i) {
      point.sdf[i] = static_cast<float>(voxel[i].sdf);
      point.luma[i] = static_cast<float>(voxel[i].luma);
      point.surface &= voxel[i].sdf != kSdfMax;
    }
    point.fraction = p.cell.fraction;
    point.arm = p.arm;
    point.measured_luma = luma;
    return true;
  }

  /// All of it for one pixel; the plain form that the vector loops of the CPU are checked against.
  template <class Cache>
  STILLMAP_HD void operator()(int32_t row, int32_t col, Cache& cache, NormalEqT<float>& sums) const {
    const float trusted = trust01(row, col), z_m = depth_m.at(row, col);
    if (!(z_m > 0.0f && z_m <= max_m) || trusted == 0.0f) return;
    sums.sum[kConsidered] += 1.0f;
    TrackPoint<float> point;
    if (fetch(row, col, z_m, static_cast<float>(colour.at(row, col).luma), cache, point))
      add_point(point_terms(point, weights), point.arm, 1.0f, trusted, sums.sum);
  }
};

}  // namespace stillmap
