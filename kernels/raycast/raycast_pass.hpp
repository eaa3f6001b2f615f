#pragma once

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/raycast/cast_ray.hpp"
#include "kernels/raycast/ray_ranges.hpp"

namespace stillmap {

/// Whether a view can be made: an image that is not empty nor wider than 32767 pixels, and a rotation. False
/// also for what is not a number.
inline bool is_view(const Se3& T_map_cam, const Intrinsics& k) {
  constexpr int32_t kMaxViewEdge = 32767;
  bool good = k.fx > 0 && k.fy > 0 && k.width >= 1 && k.height >= 1 && k.width <= kMaxViewEdge &&
              k.height <= kMaxViewEdge;
  for (int row = 0; row < 3; ++row) {
    const Mat3& r = T_map_cam.rotation;
    const Vec3 v = {r(row, 0), r(row, 1), r(row, 2)};
    good = good && fabsf(dot(v, v) - 1.0f) < 0.01f;
  }
  return good;
}

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
  RayRanges ranges = {};       ///< optional; see ray_ranges.hpp

  template <class Blocks>
  STILLMAP_HD void operator()(int32_t row, int32_t col, Blocks& blocks) const {
    const Vec3 direction =
        T_map_cam.rotation * unproject(k, static_cast<float>(col), static_cast<float>(row), 1.0f);
    Ray ray{T_map_cam.translation, direction, near_m, far_m, through_backs};
    if (ranges.tiles.data) narrow(ray, ranges.of_pixel(row, col));
    const RayHit hit = cast_ray(map, ray, blocks);
    depth_m.at(row, col) = hit.depth_m;
    colour.at(row, col) = hit.colour;
  }

 private:
  /// A range holds the cells of its surfaces whole: where it begins the ray is outside of them. A voxel more
  /// covers rounding.
  STILLMAP_HD void narrow(Ray& ray, RayRange range) const {
    ray.near_m = max_of(ray.near_m, float_of(range.nearest_bits) - map.voxel_m);
    ray.far_m = min_of(ray.far_m, float_of(range.farthest_bits) + map.voxel_m);
  }
};

}  // namespace stillmap
