#pragma once

// The residuals of one point against the map and their share of the normal equations (paper section III-B).
// Without branches, so that a loop over points becomes vector code.

#include "kernels/base/normal_eq.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// A measured point with the voxels around it.
struct TrackPoint {
  VoxelSurface voxel[8];  ///< as in Corners, all observed
  Vec3 fraction;          ///< of the point between them, 0..1
  Vec3 arm;               ///< camera centre to point, metres, map axes
  float luma = 0;         ///< measured intensity, 0..1
};

struct TrackWeights {
  float sdf_unit_m = 0;  ///< metres in one unit of VoxelSurface::sdf
  float inv_voxel_m = 0;
  float colour_weight = 0;  ///< w_c
  float huber_m = 0;        ///< > 0; a very large one: squared error
  float inlier_m = 0;
};

/// One point's terms. Residual r, gradient g by the point's position and weight w, for depth (E_d) and colour
/// (E_c). The Jacobian by the twist (v, w) about the camera centre is [g, arm x g].
struct PointTerms {
  Vec3 depth_gradient, colour_gradient;
  float depth_residual_m, colour_residual;
  float depth_weight,
      colour_weight;  ///< 0 where a voxel is at the truncation distance: no direction to move in
  float cost;         ///< robust depth cost + w_c squared colour error
  float inlier;       ///< 1: within inlier_m of the surface
};

/// Eq. (2) to (4) of the paper at one point; distance, intensity and both gradients from the same eight
/// voxels.
/// @thread any (pure)                                                    test: track_test
STILLMAP_HD PointTerms point_terms(const TrackPoint& point, const TrackWeights& w) {
  float sdf[8], luma[8];
  bool surface = true;
  for (int i = 0; i < 8; ++i) {
    sdf[i] = static_cast<float>(point.voxel[i].sdf);
    luma[i] = static_cast<float>(point.voxel[i].luma);
    surface &= point.voxel[i].sdf != kSdfMax;
  }
  PointTerms t;
  const float r = trilinear(sdf, point.fraction) * w.sdf_unit_m, size = fabsf(r);
  const bool linear = size > w.huber_m;
  t.depth_residual_m = r;
  t.depth_gradient = (w.sdf_unit_m * w.inv_voxel_m) * trilinear_gradient(sdf, point.fraction);
  t.depth_weight = surface ? (linear ? w.huber_m / size : 1.0f) : 0.0f;
  t.colour_residual = trilinear(luma, point.fraction) * (1.0f / kLumaScale) - point.luma;
  t.colour_gradient = (w.inv_voxel_m / kLumaScale) * trilinear_gradient(luma, point.fraction);
  t.colour_weight = surface ? w.colour_weight : 0.0f;
  t.cost = (linear ? w.huber_m * (2.0f * size - w.huber_m) : r * r) +
           t.colour_weight * t.colour_residual * t.colour_residual;
  t.inlier = size <= w.inlier_m ? 1.0f : 0.0f;
  return t;
}

/// Adds a point to the sums.
/// @param live 1, or 0 to add nothing
/// @param sum kTerms numbers, `stride` apart: 1 for a plain NormalEqT, the number of lanes for lanes side by
/// side
STILLMAP_HD void add_point(const PointTerms& t, Vec3 arm, float live, float* sum, int32_t stride) {
  const Vec3 depth_turn = cross(arm, t.depth_gradient), colour_turn = cross(arm, t.colour_gradient);
  const float jd[6] = {t.depth_gradient.x, t.depth_gradient.y, t.depth_gradient.z,
                       depth_turn.x,       depth_turn.y,       depth_turn.z};
  const float jc[6] = {t.colour_gradient.x, t.colour_gradient.y, t.colour_gradient.z,
                       colour_turn.x,       colour_turn.y,       colour_turn.z};
  const float wd = live * t.depth_weight, wc = live * t.colour_weight;
  int32_t k = kHessian;
  for (int32_t r = 0; r < 6; ++r) {
    const float wjd = wd * jd[r], wjc = wc * jc[r];
    for (int32_t c = r; c < 6; ++c) sum[stride * k++] += wjd * jd[c] + wjc * jc[c];
    sum[stride * (kGradient + r)] += wjd * t.depth_residual_m + wjc * t.colour_residual;
  }
  sum[stride * kCost] += live * t.cost;
  sum[stride * kSumSdf2] += live * t.inlier * t.depth_residual_m * t.depth_residual_m;
  sum[stride * kPoints] += live;
  sum[stride * kInliers] += live * t.inlier;
}

}  // namespace stillmap
