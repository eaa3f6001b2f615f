#pragma once

// The inner corner of a room, three textured planes at right angles, as a formula: its distance field, and
// what a camera in it sees. An optional box may stand before the planes.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "kernels/map/voxel.hpp"
#include "tests/support/analytic_map.hpp"

namespace stillmap::test {

/// A pinhole view of 60 degrees that sees all three planes from the origin.
inline Intrinsics corner_camera(int32_t width) {
  const float w = static_cast<float>(width);
  return {0.82f * w, 0.82f * w, 0.5f * w - 0.5f, 0.375f * w - 0.5f, width, width * 3 / 4};
}

/// Free space is x < wall_x, y < floor_y, z < back_z (map frame, metres).
struct CornerScene {
  double wall_x = 0.7, floor_y = 0.5, back_z = 2.0;
  bool textured = true;
  struct Box {
    Vec3d low, high;
  };
  std::optional<Box> box;

  /// 0..1, smooth: features of about 0.3 m.
  double luma_at(Vec3d p) const {
    if (!textured) return 0.5;
    return 0.5 + 0.15 * std::sin(21.0 * p.x + 1.0) + 0.15 * std::sin(23.0 * p.y + 2.0) +
           0.15 * std::sin(19.0 * p.z);
  }
  Rgb8 colour_at(Vec3d p) const {
    const auto grey = static_cast<uint8_t>(std::lround(255.0 * luma_at(p)));
    return {grey, grey, grey};
  }

  double sdf_m(Vec3d p) const {
    const double planes = std::min({wall_x - p.x, floor_y - p.y, back_z - p.z});
    if (!box) return planes;
    const Vec3d centre = 0.5 * (box->low + box->high), half = 0.5 * (box->high - box->low);
    return std::min(planes, box_sdf(p, centre, half));
  }

  /// Depth along the optical axis of the first surface on a ray.
  /// @param box_hit set to whether that is the box
  double depth_m(const Intrinsics& k, const Se3d& T_map_cam, double u, double v,
                 bool* box_hit = nullptr) const {
    const Vec3d direction =
        T_map_cam.rotation * Vec3d{(u - static_cast<double>(k.cx)) / static_cast<double>(k.fx),
                                   (v - static_cast<double>(k.cy)) / static_cast<double>(k.fy), 1.0};
    const Vec3d o = T_map_cam.translation;
    double z_m = 1e9;
    const auto plane = [&](double at, double from, double along) {
      if (along > 1e-9 && at > from) z_m = std::min(z_m, (at - from) / along);
    };
    plane(wall_x, o.x, direction.x);
    plane(floor_y, o.y, direction.y);
    plane(back_z, o.z, direction.z);
    const double box_m = box ? enter_box_m(o, direction) : 1e9;
    if (box_hit) *box_hit = box_m < z_m;
    return std::min(z_m, box_m);
  }

 private:
  /// 1e9 when the ray misses.
  double enter_box_m(Vec3d o, Vec3d d) const {
    double enter = 0, leave = 1e9;
    const double from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z};
    const double low[3] = {box->low.x, box->low.y, box->low.z},
                 high[3] = {box->high.x, box->high.y, box->high.z};
    for (int a = 0; a < 3; ++a) {
      if (std::fabs(along[a]) < 1e-12) {
        if (from[a] < low[a] || from[a] > high[a]) return 1e9;
        continue;
      }
      const double t0 = (low[a] - from[a]) / along[a], t1 = (high[a] - from[a]) / along[a];
      enter = std::max(enter, std::min(t0, t1));
      leave = std::min(leave, std::max(t0, t1));
    }
    return enter < leave && enter > 0 ? enter : 1e9;
  }
};

/// Images of a scene from one pose.
struct CornerView {
  Intrinsics k;
  std::vector<float> depth_m;
  std::vector<uint16_t> depth_raw;  ///< 5000 units a metre
  std::vector<Rgb8> colour;
  std::vector<LumaChroma> luma;
  std::vector<uint8_t> on_box;  ///< 1 where the box is seen

  CornerView(const CornerScene& scene, const Intrinsics& camera, const Se3d& T_map_cam) : k(camera) {
    for (int32_t r = 0; r < k.height; ++r)
      for (int32_t c = 0; c < k.width; ++c) {
        bool box_hit = false;
        const double z_m = scene.depth_m(k, T_map_cam, c, r, &box_hit);
        const Vec3d p_cam = {(c - static_cast<double>(k.cx)) / static_cast<double>(k.fx) * z_m,
                             (r - static_cast<double>(k.cy)) / static_cast<double>(k.fy) * z_m, z_m};
        depth_m.push_back(static_cast<float>(z_m));
        depth_raw.push_back(static_cast<uint16_t>(std::lround(std::min(5000.0 * z_m, 65534.0))));
        colour.push_back(scene.colour_at(T_map_cam * p_cam));
        luma.push_back(luma_chroma(colour.back()));
        on_box.push_back(box_hit);
      }
  }

  template <class T>
  ImageView<const T> image(const std::vector<T>& pixels) const {
    return {pixels.data(), k.height, k.width, k.width};
  }
};

/// The scene as a map: all blocks within the truncation distance of its planes, in the box that
/// corner_camera() looks into.
inline AnalyticMap corner_map(const CornerScene& scene, float voxel_m, float truncation_m) {
  AnalyticMap map(20000, voxel_m, truncation_m);
  const double block_m = 8.0 * static_cast<double>(voxel_m);
  const auto at = [&](double m) { return static_cast<int32_t>(std::floor(m / block_m)); };
  const double band_m = static_cast<double>(truncation_m) + block_m;
  const auto field = [&](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = scene.sdf_m(p);
    s.observed = s.sdf_m > -static_cast<double>(truncation_m);
    s.colour = scene.colour_at(p);
    return s;
  };
  for (int32_t z = at(0.3); z <= at(2.2); ++z)
    for (int32_t y = at(-1.5); y <= at(0.7); ++y)
      for (int32_t x = at(-2.0); x <= at(0.9); ++x) {
        const Vec3d centre = {(x + 0.5) * block_m, (y + 0.5) * block_m, (z + 0.5) * block_m};
        if (std::fabs(scene.sdf_m(centre)) < band_m) map.fill({x, y, z}, {x, y, z}, field);
      }
  return map;
}

}  // namespace stillmap::test
