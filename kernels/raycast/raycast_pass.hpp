#pragma once

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/raycast/cast_ray.hpp"

namespace stillmap {

/// One pixel of a view of the map. Both images have the size of `k`.
struct RaycastPass {
  VolumeView map;
  Intrinsics k;
  Se3 T_map_cam;
  ImageView<float> depth_m;  ///< camera z; 0: nothing
  ImageView<Rgb8> colour;    ///< black where there is nothing
  float near_m = 0.05f;
  float far_m = 10.0f;
  bool through_backs = false;  ///< true: walls seen from behind are transparent (views from outside a room)

  template <class Blocks>
  STILLMAP_HD void operator()(int32_t row, int32_t col, Blocks& blocks) const {
    const Vec3 direction =
        T_map_cam.rotation * unproject(k, static_cast<float>(col), static_cast<float>(row), 1.0f);
    const RayHit hit =
        cast_ray(map, {T_map_cam.translation, direction, near_m, far_m, through_backs}, blocks);
    depth_m.at(row, col) = hit.depth_m;
    colour.at(row, col) = hit.colour;
  }
};

}  // namespace stillmap
