#pragma once

// The residuals of one point against the map and their share of the normal equations (paper section III-B).
// Over a number type (base/lane.hpp): one point, or several side by side.

#include "kernels/base/lane.hpp"
#include "kernels/base/normal_eq.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// A measured point with the voxels around it.
template <class F>
struct TrackPoint {
  F sdf[8], luma[8];  ///< of the eight voxels in their own units, as read_corners orders them; all observed
  MaskOf<F> surface;  ///< none of them is at the truncation distance
  Vec3T<F> fraction;  ///< of the point between them, 0..1
  Vec3T<F> arm;       ///< camera centre to point, metres, map axes
  F measured_luma;    ///< kLumaScale is white
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
template <class F>
struct PointTerms {
  Vec3T<F> depth_gradient, colour_gradient;
  F depth_residual_m, colour_residual;
  F depth_weight, colour_weight;  ///< 0 where a voxel is at the truncation distance: no direction to move in
  F cost;                         ///< robust depth cost + w_c squared colour error
  F inlier;                       ///< 1: within inlier_m of the surface
};

/// Eq. (2) to (4) of the paper at one point; distance, intensity and both gradients from the same eight
/// voxels. Intensities are 0..1.
/// @thread any (pure)                                                    test: track_test
template <class F>
STILLMAP_HD PointTerms<F> point_terms(const TrackPoint<F>& point, const TrackWeights& w) {
  constexpr float kIntensity = 1.0f / kLumaScale;
  const F huber_m = F(w.huber_m), none = F(0.0f), one = F(1.0f);
  PointTerms<F> t;
  Vec3T<F> gradient;
  const F r = F(w.sdf_unit_m) * trilinear(point.sdf, point.fraction, gradient), size = abs_of(r);
  const MaskOf<F> linear = size > huber_m;
  t.depth_residual_m = r;
  t.depth_gradient = F(w.sdf_unit_m * w.inv_voxel_m) * gradient;
  t.depth_weight = select(point.surface, select(linear, huber_m / size, one), none);
  t.colour_residual = F(kIntensity) * (trilinear(point.luma, point.fraction, gradient) - point.measured_luma);
  t.colour_gradient = F(kIntensity * w.inv_voxel_m) * gradient;
  t.colour_weight = select(point.surface, F(w.colour_weight), none);
  t.cost = select(linear, huber_m * (size + size - huber_m), r * r) +
           t.colour_weight * t.colour_residual * t.colour_residual;
  t.inlier = select(size <= F(w.inlier_m), one, none);
  return t;
}

/// Adds a point to kTerms sums.
/// @param live 1, or 0 to add nothing
template <class F>
STILLMAP_HD void add_point(const PointTerms<F>& t, Vec3T<F> arm, F live, F* sum) {
  const Vec3T<F> depth_turn = cross(arm, t.depth_gradient), colour_turn = cross(arm, t.colour_gradient);
  const F jd[6] = {t.depth_gradient.x, t.depth_gradient.y, t.depth_gradient.z,
                   depth_turn.x,       depth_turn.y,       depth_turn.z};
  const F jc[6] = {t.colour_gradient.x, t.colour_gradient.y, t.colour_gradient.z,
                   colour_turn.x,       colour_turn.y,       colour_turn.z};
  const F wd = live * t.depth_weight, wc = live * t.colour_weight;
  int32_t k = kHessian;
  for (int32_t r = 0; r < 6; ++r) {
    const F wjd = wd * jd[r], wjc = wc * jc[r];
    for (int32_t c = r; c < 6; ++c) sum[k++] += wjd * jd[c] + wjc * jc[c];
    sum[kGradient + r] += wjd * t.depth_residual_m + wjc * t.colour_residual;
  }
  sum[kCost] += live * t.cost;
  sum[kSumSdf2] += live * t.inlier * t.depth_residual_m * t.depth_residual_m;
  sum[kPoints] += live;
  sum[kInliers] += live * t.inlier;
}

}  // namespace stillmap
