#pragma once

// Does what the camera measures fit the map at a pose? Asked of every cell; a found pose is believed only
// when hardly anything contradicts it.

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/params.hpp"
#include "kernels/relocalise/small_view.hpp"

namespace stillmap {

/// What a cell says about the pose.
enum class CellVerdict : uint8_t {
  none,     ///< no depth
  on,       ///< on a mapped surface
  front,    ///< before the mapped surface, in free space: a mover, or a wrong pose
  through,  ///< behind a mapped surface: contradicts
  unknown   ///< where the map knows nothing
};

/// One cell against the map and against the view that the map promises.        test: view_check_test
struct ViewCheckPass {
  VolumeView map;
  SmallView view;
  Intrinsics k;
  Se3 T_map_cam;
  ImageView<const float> expected_m;  ///< the map seen from this pose, size of the view; 0: nothing
  ImageView<float> map_luma;          ///< out: luminance of the map where the verdict is `on`, else kNoLuma
  float tolerance_m = 0.02f;
  float tolerance_per_m2 = 0.0015f;  ///< the sensor's noise grows with the squared depth

  template <class Cache>
  STILLMAP_HD CellVerdict operator()(int32_t row, int32_t col, Cache& cache) const {
    map_luma.at(row, col) = kNoLuma;
    const float z_m = view.depth_m.at(row, col);
    if (z_m <= 0.0f) return CellVerdict::none;
    const float tolerance = tolerance_m + tolerance_per_m2 * z_m * z_m;
    const Vec3 p_map = T_map_cam * unproject(k, static_cast<float>(col), static_cast<float>(row), z_m);
    const GridCell<float> cell = cell_of((1.0f / map.voxel_m) * p_map);
    VoxelSurface voxel[8];
    const bool known = read_corners(map, {cell.x, cell.y, cell.z}, cache, voxel);
    float sdf[8], luma[8];
    bool surface = known;
    for (int32_t i = 0; known && i < 8; ++i) {
      sdf[i] = static_cast<float>(voxel[i].sdf) * map.sdf_unit_m();
      luma[i] = static_cast<float>(voxel[i].luma) * (1.0f / kLumaScale);
      surface &= voxel[i].sdf != kSdfMax;
    }
    if (surface && fabsf(trilinear(sdf, cell.fraction)) <= tolerance) {
      map_luma.at(row, col) = trilinear(luma, cell.fraction);
      return CellVerdict::on;
    }
    float nearest_m = 1e9f, farthest_m = 0;
    bool hole = false;
    for (int32_t r = row - 1; r <= row + 1; ++r)
      for (int32_t c = col - 1; c <= col + 1; ++c) {
        if (!expected_m.contains(r, c)) continue;
        const float e_m = expected_m.at(r, c);
        hole |= e_m <= 0.0f;
        if (e_m <= 0.0f) continue;
        nearest_m = min_of(nearest_m, e_m);
        farthest_m = max_of(farthest_m, e_m);
      }
    if (farthest_m > 0.0f && !hole && z_m > farthest_m + 2.0f * tolerance) return CellVerdict::through;
    if (farthest_m > 0.0f && z_m < nearest_m - 2.0f * tolerance) return CellVerdict::front;
    if (!known || farthest_m <= 0.0f) return CellVerdict::unknown;
    return CellVerdict::none;  // within the tolerance of an outline
  }
};

/// The rule that a found pose must pass.                                        test: view_check_test
STILLMAP_HD bool fits(const ViewCheck& check, const RelocaliseParams& p) {
  return check.on >= p.min_on && check.through <= p.max_through && check.front <= p.max_front &&
         check.unknown <= p.max_unknown && check.luma_correlation >= p.min_luma_correlation &&
         check.texture_correlation >= p.min_texture_correlation && check.weakest_m <= p.max_weakest_m;
}

}  // namespace stillmap
