#pragma once

#include <cstdint>

#include "kernels/base/normal_eq.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/params.hpp"
#include "kernels/track/sdf_residual.hpp"

namespace stillmap {

/// One pixel of E_d + w_c E_c (paper Eq. (4)) added to normal equations.
///
/// The increment turns about the camera centre: p' = c + v + exp(w) (p - c). Far from the map's origin this
/// keeps translation and rotation apart, which single precision needs.
struct TrackPass {
  VolumeView map;
  ImageView<const float> depth_m;
  ImageView<const float> luma;
  ImageView<const uint8_t> mask;  ///< no data: nothing is masked
  Intrinsics k;
  Se3 T_map_cam;
  float max_m = 0;
  float colour_weight = 0;
  float huber_m = 0;  ///< 0: squared error
  float inlier_m = 0;

  STILLMAP_HD void operator()(int32_t row, int32_t col, BlockCache& cache, NormalEqT<float>& sums) const {
    const float z_m = depth_m.at(row, col);
    if (!(z_m > 0.0f && z_m <= max_m)) return;
    if (mask.data && mask.at(row, col)) return;
    sums.considered += 1.0f;
    const Vec3 p_cam = unproject(k, static_cast<float>(col), static_cast<float>(row), z_m);
    const Vec3 arm = T_map_cam.rotation * p_cam;  // camera centre to point, map axes
    PointSample sample;
    if (!sample_point(map, arm + T_map_cam.translation, cache, sample)) return;
    sums.points += 1.0f;
    add_depth(sample, arm, sums);
    if (sample.has_surface && colour_weight > 0.0f) add_colour(sample, arm, luma.at(row, col), sums);
  }

 private:
  STILLMAP_HD void add_depth(const PointSample& s, Vec3 arm, NormalEqT<float>& sums) const {
    const float r = s.sdf_m, size = fabsf(r);
    if (size <= inlier_m) {
      sums.inliers += 1.0f;
      sums.sum_sdf2 += r * r;
    }
    const bool linear = huber_m > 0.0f && size > huber_m;
    sums.cost += linear ? huber_m * (2.0f * size - huber_m) : r * r;
    if (!s.has_surface) return;  // in free space: no direction to move in
    const float j[6] = {s.sdf_gradient.x,
                        s.sdf_gradient.y,
                        s.sdf_gradient.z,
                        cross(arm, s.sdf_gradient).x,
                        cross(arm, s.sdf_gradient).y,
                        cross(arm, s.sdf_gradient).z};
    sums.add(j, r, linear ? huber_m / size : 1.0f);
  }
  STILLMAP_HD void add_colour(const PointSample& s, Vec3 arm, float measured, NormalEqT<float>& sums) const {
    const float r = s.luma - measured;
    const Vec3 turn = cross(arm, s.luma_gradient);
    const float j[6] = {s.luma_gradient.x, s.luma_gradient.y, s.luma_gradient.z, turn.x, turn.y, turn.z};
    sums.cost += colour_weight * r * r;
    sums.add(j, r, colour_weight);
  }
};

}  // namespace stillmap
