#include <algorithm>
#include <cmath>

#include "drivers/synthetic/builders.hpp"

namespace stillmap::synthetic {

namespace {

float box_distance_m(Vec3 p, Vec3 half) {
  const Vec3 q = {std::abs(p.x) - half.x, std::abs(p.y) - half.y, std::abs(p.z) - half.z};
  const Vec3 outside = {std::max(q.x, 0.0f), std::max(q.y, 0.0f), std::max(q.z, 0.0f)};
  return norm(outside) + std::min(std::max({q.x, q.y, q.z}), 0.0f);
}

float ellipsoid_distance_m(Vec3 p, Vec3 half) {
  const Vec3 a = {p.x / half.x, p.y / half.y, p.z / half.z};
  const Vec3 b = {a.x / half.x, a.y / half.y, a.z / half.z};
  const float slope = norm(b);
  if (slope == 0.0f) return -std::min({half.x, half.y, half.z});
  return norm(a) * (norm(a) - 1.0f) / slope;
}

float capsule_distance_m(Vec3 p, Vec3 half) {
  const float z = p.z - std::clamp(p.z, -half.z, half.z);
  return norm(Vec3{p.x, p.y, z}) - half.x;
}

/// Rotation whose z axis is `z`, unit length; the other two are any.
Mat3 rotation_with_z(Vec3 z) {
  const Vec3 helper = std::abs(z.x) < 0.8f ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 y = normalized(cross(z, helper));
  const Vec3 x = cross(y, z);
  return {{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}};
}

}  // namespace

float distance_m(const Shape& shape, Vec3 p_world) {
  const Vec3 p = transposed(shape.T_world_local.rotation) * (p_world - shape.T_world_local.translation);
  switch (shape.kind) {
    case Kind::room:
      return -box_distance_m(p, shape.half_m);
    case Kind::box:
      return box_distance_m(p, shape.half_m);
    case Kind::ellipsoid:
      return ellipsoid_distance_m(p, shape.half_m);
    case Kind::capsule:
      return capsule_distance_m(p, shape.half_m);
  }
  return 0.0f;
}

Se3d look(Vec3d position_m, double yaw, double pitch, double roll) {
  const Vec3d forward = {std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch)};
  const Vec3d level_right = {std::sin(yaw), -std::cos(yaw), 0.0};
  const Vec3d level_down = cross(forward, level_right);
  const Vec3d right = std::cos(roll) * level_right + std::sin(roll) * level_down;
  const Vec3d down = cross(forward, right);
  return {{{right.x, down.x, forward.x, right.y, down.y, forward.y, right.z, down.z, forward.z}}, position_m};
}

Mat3 yaw_rotation(float yaw) {
  const float c = std::cos(yaw), s = std::sin(yaw);
  return {{c, -s, 0, s, c, 0, 0, 0, 1}};
}

Shape make_box(Vec3 centre_m, Vec3 half_m, const Material& material, float yaw) {
  return {Kind::box, false, half_m, {yaw_rotation(yaw), centre_m}, material};
}

Shape make_ellipsoid(Vec3 centre_m, Vec3 half_m, const Material& material, float yaw) {
  return {Kind::ellipsoid, false, half_m, {yaw_rotation(yaw), centre_m}, material};
}

Shape make_capsule(Vec3 a_m, Vec3 b_m, float radius_m, const Material& material) {
  const Vec3 axis = b_m - a_m;
  const float length = norm(axis);
  const Vec3 z = length > 1e-6f ? (1.0f / length) * axis : Vec3{0, 0, 1};
  return {Kind::capsule,
          false,
          {radius_m, radius_m, 0.5f * length},
          {rotation_with_z(z), 0.5f * (a_m + b_m)},
          material};
}

Shape make_block(Vec3 low_m, Vec3 high_m, const Material& material) {
  return make_box(0.5f * (low_m + high_m), 0.5f * (high_m - low_m), material);
}

}  // namespace stillmap::synthetic
