#pragma once

// The residuals of one point against the map and their share of the normal equations (paper section III-B).
// Over a number type (base/lane.hpp): one point, or several side by side.

#include "kernels/base/lane.hpp"
#include "kernels/base/normal_eq.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/params.hpp"

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
  float inlier_m = 0;
  RobustKernel kernel = RobustKernel::huber;
  float kernel_m = 0;           ///< scale of the kernel, > 0; a very large one: squared error
  float kernel_per_range2 = 0;  ///< grows with the square of the range: this much at 1 m, metres
};

/// Of an error e: the cost, about e^2 where e is small, and the weight of the reweighted least squares.
template <class F>
struct Robust {
  F cost, weight;
};

/// Huber: beyond `scale` the pull stays the same.
template <class F>
STILLMAP_HD Robust<F> huber(F size, F scale) {
  const MaskOf<F> linear = size > scale;
  return {select(linear, scale * (size + size - scale), size * size), select(linear, scale / size, F(1.0f))};
}
/// Geman and McClure: redescends, what is far beyond `scale` does not pull at all.
template <class F>
STILLMAP_HD Robust<F> geman_mcclure(F size2, F scale) {
  const F trust = scale * scale / (scale * scale + size2);
  return {size2 * trust, trust * trust};
}

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
  const F none = F(0.0f), one = F(1.0f);
  PointTerms<F> t;
  Vec3T<F> gradient;
  const F r = F(w.sdf_unit_m) * trilinear(point.sdf, point.fraction, gradient), size = abs_of(r);
  t.depth_residual_m = r;
  t.depth_gradient = F(w.sdf_unit_m * w.inv_voxel_m) * gradient;
  t.colour_residual = F(kIntensity) * (trilinear(point.luma, point.fraction, gradient) - point.measured_luma);
  t.colour_gradient = F(kIntensity * w.inv_voxel_m) * gradient;
  const F colour2 = F(w.colour_weight) * t.colour_residual * t.colour_residual;
  const F scale = F(w.kernel_m) + F(w.kernel_per_range2) * dot(point.arm, point.arm);
  if (w.kernel == RobustKernel::huber) {
    const Robust<F> depth = huber(size, scale);
    t.depth_weight = select(point.surface, depth.weight, none);
    t.colour_weight = select(point.surface, F(w.colour_weight), none);
    t.cost = depth.cost + select(point.surface, colour2, none);
  } else {
    const Robust<F> joint = geman_mcclure(r * r + select(point.surface, colour2, none), scale);
    t.depth_weight = select(point.surface, joint.weight, none);
    t.colour_weight = F(w.colour_weight) * t.depth_weight;
    t.cost = joint.cost;
  }
  t.inlier = select(size <= F(w.inlier_m), one, none);
  return t;
}

/// Adds a point to kTerms sums.
/// @param live 1, or 0 to add nothing; @param trust 0..1, multiplies what the point weighs, not the counts
template <class F>
STILLMAP_HD void add_point(const PointTerms<F>& t, Vec3T<F> arm, F live, F trust, F* sum) {
  const Vec3T<F> depth_turn = cross(arm, t.depth_gradient), colour_turn = cross(arm, t.colour_gradient);
  const F jd[6] = {t.depth_gradient.x, t.depth_gradient.y, t.depth_gradient.z,
                   depth_turn.x,       depth_turn.y,       depth_turn.z};
  const F jc[6] = {t.colour_gradient.x, t.colour_gradient.y, t.colour_gradient.z,
                   colour_turn.x,       colour_turn.y,       colour_turn.z};
  const F weight = live * trust, wd = weight * t.depth_weight, wc = weight * t.colour_weight;
  int32_t k = kHessian;
  for (int32_t r = 0; r < 6; ++r) {
    const F wjd = wd * jd[r], wjc = wc * jc[r];
    for (int32_t c = r; c < 6; ++c) sum[k++] += wjd * jd[c] + wjc * jc[c];
    sum[kGradient + r] += wjd * t.depth_residual_m + wjc * t.colour_residual;
  }
  sum[kCost] += weight * t.cost;
  sum[kWeight] += weight;
  sum[kSumSdf2] += live * t.inlier * t.depth_residual_m * t.depth_residual_m;
  sum[kPoints] += live;
  sum[kInliers] += live * t.inlier;
}

}  // namespace stillmap
