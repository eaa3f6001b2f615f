#pragma once

// Exact images of a World: what an ideal camera would see.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/texture.hpp"
#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/view.hpp"

namespace stillmap::synthetic {

/// Images of one size, rows x cols, without gaps between rows.
struct IdealImages {
  std::vector<float> depth_m;        ///< along the optical axis, > 0 everywhere: a room has walls
  std::vector<float> cos_incidence;  ///< between ray and surface normal, 0 grazing .. 1 straight
  std::vector<Rgb8> colour;
  std::vector<uint8_t> mask;  ///< 255: the visible surface moves
};

/// A channel of a colour, rounded and kept within 0..255.
inline uint8_t to_byte(float v) {
  return static_cast<uint8_t>(std::clamp(v + 0.5f, 0.0f, 255.0f));
}

/// What a camera sees with a hand on its lens: dark, nearer than it can measure, all of it moving.
void cover_lens(IdealImages& images);

/// Ray caster: tiles, each with the shapes whose outline touches it and that are not behind all of its hits;
/// the nearest are asked first.
/// @thread one caller at a time
class Renderer {
 public:
  explicit Renderer(const Intrinsics& k);

  /// Writes all of `images`. The camera is inside the room.
  void render(const World& world, const Se3d& T_world_cam, ThreadPool& workers, IdealImages& images);

 private:
  static constexpr int32_t kTile = 16;

  /// A shape as the rays of one frame see it: local direction = direction * (x, y, 1), local origin = camera.
  struct CastShape {
    Kind kind = Kind::box;
    Mat3 direction;
    Vec3 origin;
    Vec3 half_m;
    float radius = 0, half_axis = 0;
    float nearest_m = 0;  ///< no point of it has a smaller depth
    int32_t first_tile_col = 0, last_tile_col = -1, first_tile_row = 0, last_tile_row = -1;
  };
  struct Hits;

  CastShape cast_shape(const Shape& shape, const Se3d& T_world_cam) const;
  void find_tiles(const Shape& shape, const Se3& T_cam_world, CastShape& cast) const;
  void find_order();
  void render_tile(const World& world, const Se3d& T_world_cam, int32_t tile, IdealImages& images) const;
  void intersect(const CastShape& cast, int32_t index, Hits& hits) const;
  void shade(const World& world, Vec3 camera_world, const Hits& hits, IdealImages& images) const;

  Intrinsics k_;
  int32_t tile_cols_, tile_rows_;
  std::vector<CastShape> cast_;
  std::vector<int32_t> nearest_first_;  ///< those in view, by `nearest_m`
  ValueNoise noise_;
};

}  // namespace stillmap::synthetic
