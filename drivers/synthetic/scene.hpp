#pragma once

// What a synthetic scene is made of: shapes with materials, a camera path, and movers as functions of time.
// World frame: x and y level, z up, origin on the floor in the middle of the room, metres.

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/se3.hpp"
#include "kernels/base/vec.hpp"

namespace stillmap::synthetic {

enum class Pattern : uint8_t { plain, paint, cloud, stripes, checks, planks, wallpaper, poster, spines };

/// Colour of a surface as a function of its own coordinates, see texture.hpp.
struct Material {
  Pattern pattern = Pattern::plain;
  Vec3 colour_a = {200, 200, 200};  ///< sRGB, 0..255
  Vec3 colour_b = {120, 120, 120};  ///< second colour of the pattern
  float scale_m = 0.1f;             ///< size of the pattern's features
  uint32_t variant = 0;             ///< another drawing of the same pattern
};

enum class Kind : uint8_t {
  room,       ///< box seen from within; `half_m` half edges, `floor` and `ceiling` have their own materials
  box,        ///< `half_m`: half edges along the local axes
  ellipsoid,  ///< `half_m`: semi-axes
  capsule     ///< along local z: half_m.x radius, half_m.z half length of its axis
};

/// One solid. `T_world_local` places it; all its dimensions are along its local axes.
struct Shape {
  Kind kind = Kind::box;
  bool moving = false;  ///< belongs to the true dynamic mask at this instant
  Vec3 half_m;
  Se3 T_world_local;
  Material material;
  bool put_down = false;  ///< moved within the last second, and stands still now
};

/// Surfaces of a room besides its walls.
struct RoomMaterials {
  Material floor;
  Material ceiling;
};

/// The world at one instant. `shapes[0]` is the room.
struct World {
  std::vector<Shape> shapes;
  RoomMaterials room;
  float lamp_spacing_m = 0;  ///< the lamp is there again and again along x; 0: only once
};

/// Distance from `p_world` to the surface, metres, negative inside the solid (for the room: outside of its
/// free space). Exact for boxes and capsules, first order for ellipsoids.
float distance_m(const Shape& shape, Vec3 p_world);

/// Camera that looks along `yaw` (from x towards y) and `pitch` (up), then rolls about its axis; radians.
/// @return T_world_cam, optical frame (x right, y down, z forward)
Se3d look(Vec3d position_m, double yaw, double pitch, double roll);

/// A scene of the table in scenes.cpp; all are pure functions of time (seconds from the first frame).
struct Scene {
  const char* name;
  double default_seconds;
  bool dynamic;  ///< has movers
  void (*still)(World& world);
  void (*movers)(double t_s, World& world);
  Se3d (*camera)(double t_s);
  bool (*covered)(double t_s) = nullptr;  ///< a hand lies on the lens; null: never
  bool sonar = false;                     ///< frames come with a reading (sonar.hpp)
};

/// @return null when there is no such scene (names without "-static").
const Scene* find_scene(const std::string& name);
const std::vector<Scene>& all_scenes();

/// Everything there is at time `t_s`; movers left out when `without_movers`.
World world_at(const Scene& scene, double t_s, bool without_movers);

/// Points about every `step_m` on what stands still in `world`; parts that lie within or against another
/// solid are left out, since no camera can see them.
std::vector<Vec3> sample_still_surface(const World& world, float step_m);

}  // namespace stillmap::synthetic
