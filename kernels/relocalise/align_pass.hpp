#pragma once

// One cell's share of the normal equations of the two alignments that lead from a keyframe to a pose: against
// a view of the map from nearby (wide basin), then against the distances in the map (precise).

#include <cstdint>

#include "kernels/base/normal_eq.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/relocalise/small_view.hpp"

namespace stillmap {

/// A view of the map with the normals of its surface.
struct ModelView {
  Intrinsics k;
  Se3 T_map_model;
  ImageView<float> depth_m;  ///< 0: nothing
  ImageView<Vec3> normal;    ///< in the model's camera frame, towards it; 0: none
};

/// Normal at a cell from its neighbours to the left, right, above and below.  test: align_test
struct NormalPass {
  ModelView model;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    Vec3& normal = model.normal.at(row, col);
    normal = {};
    const float z_m = model.depth_m.at(row, col);
    if (z_m <= 0.0f || row < 1 || col < 1 || row + 1 >= model.depth_m.rows || col + 1 >= model.depth_m.cols)
      return;
    Vec3 across, down;
    if (!difference(row, col - 1, row, col + 1, z_m, across) ||
        !difference(row - 1, col, row + 1, col, z_m, down))
      return;
    const Vec3 n = normalized(cross(down, across));  // right x down looks away from the camera
    const Vec3 ray = unproject(model.k, static_cast<float>(col), static_cast<float>(row), 1.0f);
    constexpr float kGrazing = 0.1f;
    if (-dot(n, normalized(ray)) > kGrazing) normal = n;
  }

 private:
  STILLMAP_HD bool difference(int32_t r0, int32_t c0, int32_t r1, int32_t c1, float z_m, Vec3& out) const {
    const float z0_m = model.depth_m.at(r0, c0), z1_m = model.depth_m.at(r1, c1);
    if (z0_m <= 0.0f || z1_m <= 0.0f || fabsf(z1_m - z0_m) > 2.0f * kCellEdge * z_m) return false;
    out = unproject(model.k, static_cast<float>(c1), static_cast<float>(r1), z1_m) -
          unproject(model.k, static_cast<float>(c0), static_cast<float>(r0), z0_m);
    return true;
  }
};

/// Adds a residual with its gradient by the point's position: Jacobian [g, arm x g] by the twist about the
/// camera centre.
STILLMAP_HD void add_residual(float residual, Vec3 gradient, Vec3 arm, float weight, double* sum) {
  const Vec3 turn = cross(arm, gradient);
  const float j[6] = {gradient.x, gradient.y, gradient.z, turn.x, turn.y, turn.z};
  int32_t k = kHessian;
  for (int32_t r = 0; r < 6; ++r) {
    const float wj = weight * j[r];
    for (int32_t c = r; c < 6; ++c) sum[k++] += static_cast<double>(wj * j[c]);
    sum[kGradient + r] += static_cast<double>(wj * residual);
  }
}

/// Weight of a residual that redescends to 0 at `limit` (Tukey).
STILLMAP_HD float tukey(float residual, float limit) {
  const float x = residual / limit, rest = 1.0f - x * x;
  return rest > 0.0f ? rest * rest : 0.0f;
}

/// Sums of a pass of either alignment.
struct AlignSums {
  NormalEq eq;  ///< kInliers: cells within the gate
  double measured_luma = 0, map_luma = 0;
};

/// Point to plane, the plane found by projection into the view of the map.  test: align_test
struct ModelAlignPass {
  SmallView view;
  Intrinsics k;
  ModelView model;
  Se3 T_map_cam;
  float gate_m = 0;  ///< farther planes are of something else

  STILLMAP_HD void operator()(int32_t row, int32_t col, AlignSums& out) const {
    NormalEq& sums = out.eq;
    const float z_m = view.depth_m.at(row, col);
    if (z_m <= 0.0f) return;
    sums.sum[kConsidered] += 1;
    const Vec3 arm = T_map_cam.rotation * unproject(k, static_cast<float>(col), static_cast<float>(row), z_m);
    const Vec3 p_model = transposed(model.T_map_model.rotation) *
                         (T_map_cam.translation + arm - model.T_map_model.translation);
    if (p_model.z < 0.1f) return;
    const Pixel at = project(model.k, p_model);
    const int32_t r = static_cast<int32_t>(floorf(at.v + 0.5f)),
                  c = static_cast<int32_t>(floorf(at.u + 0.5f));
    if (!model.depth_m.contains(r, c)) return;
    const Vec3 n_model = model.normal.at(r, c);
    if (dot(n_model, n_model) < 0.5f) return;
    const Vec3 q_model =
        unproject(model.k, static_cast<float>(c), static_cast<float>(r), model.depth_m.at(r, c));
    const float residual_m = dot(n_model, p_model - q_model);
    sums.sum[kPoints] += 1;
    if (fabsf(p_model.z - q_model.z) > 2.0f * gate_m) return;
    const float weight = tukey(residual_m, gate_m);
    if (weight <= 0.0f) return;
    sums.sum[kInliers] += 1;
    sums.sum[kSumSdf2] += static_cast<double>(residual_m * residual_m);
    add_residual(residual_m, model.T_map_model.rotation * n_model, arm, weight, sums.sum);
  }
};

/// Point to the surface in the map, by its signed distances and luminances (paper Eq. (2) to (4)).
/// test: align_test
struct MapAlignPass {
  VolumeView map;
  SmallView view;
  Intrinsics k;
  Se3 T_map_cam;
  float gate_m = 0;
  float colour_weight = 0;  ///< w_c
  float gain = 1;           ///< measured luminance over the map's

  template <class Cache>
  STILLMAP_HD void operator()(int32_t row, int32_t col, Cache& cache, AlignSums& out) const {
    NormalEq& sums = out.eq;
    const float z_m = view.depth_m.at(row, col);
    if (z_m <= 0.0f) return;
    sums.sum[kConsidered] += 1;
    const float inv_voxel = 1.0f / map.voxel_m;
    const Vec3 arm = T_map_cam.rotation * unproject(k, static_cast<float>(col), static_cast<float>(row), z_m);
    const GridCell<float> cell = cell_of(inv_voxel * (T_map_cam.translation + arm));
    VoxelSurface voxel[8];
    if (!read_corners(map, {cell.x, cell.y, cell.z}, cache, voxel)) return;
    sums.sum[kPoints] += 1;
    float sdf[8], luma[8];
    for (int32_t i = 0; i < 8; ++i) {
      if (voxel[i].sdf == kSdfMax) return;  // free space: no direction to move in
      sdf[i] = static_cast<float>(voxel[i].sdf) * map.sdf_unit_m();
      luma[i] = static_cast<float>(voxel[i].luma) * (1.0f / kLumaScale);
    }
    Vec3 gradient;
    const float distance_m = trilinear(sdf, cell.fraction, gradient);
    const float weight = tukey(distance_m, gate_m);
    if (weight <= 0.0f) return;
    sums.sum[kInliers] += 1;
    sums.sum[kSumSdf2] += static_cast<double>(distance_m * distance_m);
    add_residual(distance_m, inv_voxel * gradient, arm, weight, sums.sum);
    const float measured = view.luma.at(row, col);
    if (measured == kNoLuma) return;
    Vec3 luma_gradient;
    const float mapped = trilinear(luma, cell.fraction, luma_gradient);
    out.measured_luma += static_cast<double>(measured);
    out.map_luma += static_cast<double>(mapped);
    const float difference = gain * mapped - measured;
    constexpr float kLumaGate = 0.2f;
    add_residual(difference, gain * inv_voxel * luma_gradient, arm,
                 weight * colour_weight * tukey(difference, kLumaGate), sums.sum);
  }
};

}  // namespace stillmap
