#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/synthetic/builders.hpp"

namespace stillmap::synthetic {

namespace {

constexpr float kHiddenM = 0.003f;  // a point this near to another solid is covered by it

/// Calls put(p_local) about every `step_m` on the surface of one face of a box.
template <class Put>
void sample_face(int axis, float side, Vec3 half, float step_m, const Put& put) {
  const float h[3] = {half.x, half.y, half.z};
  const int a = (axis + 1) % 3, b = (axis + 2) % 3;
  const int cells_a = std::max(1, static_cast<int>(std::lround(2.0f * h[a] / step_m)));
  const int cells_b = std::max(1, static_cast<int>(std::lround(2.0f * h[b] / step_m)));
  for (int i = 0; i < cells_a; ++i)
    for (int j = 0; j < cells_b; ++j) {
      float p[3];
      p[axis] = side * h[axis];
      p[a] = h[a] * ((2.0f * static_cast<float>(i) + 1.0f) / static_cast<float>(cells_a) - 1.0f);
      p[b] = h[b] * ((2.0f * static_cast<float>(j) + 1.0f) / static_cast<float>(cells_b) - 1.0f);
      put(Vec3{p[0], p[1], p[2]});
    }
}

/// A sphere's directions, evenly spread along a spiral; each gives one surface point.
template <class Put>
void sample_sphere(int count, const Put& put) {
  for (int i = 0; i < count; ++i) {
    const float z = 1.0f - (2.0f * static_cast<float>(i) + 1.0f) / static_cast<float>(count);
    const float ring = std::sqrt(std::max(0.0f, 1.0f - z * z));
    const float turn = std::fmod(2.39996323f * static_cast<float>(i), 6.28318531f);
    put(Vec3{ring * std::cos(turn), ring * std::sin(turn), z});
  }
}

int sphere_points(float radius_m, float step_m) {
  return std::max(12, static_cast<int>(12.566f * radius_m * radius_m / (step_m * step_m)));
}

template <class Put>
void sample_shape(const Shape& shape, float step_m, const Put& put) {
  const Vec3 h = shape.half_m;
  switch (shape.kind) {
    case Kind::room:
    case Kind::box:
      for (int axis = 0; axis < 3; ++axis)
        for (const float side : {-1.0f, 1.0f}) sample_face(axis, side, h, step_m, put);
      break;
    case Kind::ellipsoid:
      sample_sphere(sphere_points(std::max({h.x, h.y, h.z}), step_m), [&](Vec3 n) {
        put(Vec3{n.x * h.x, n.y * h.y, n.z * h.z});
      });
      break;
    case Kind::capsule: {
      sample_sphere(sphere_points(h.x, step_m), [&](Vec3 n) {
        put(Vec3{n.x * h.x, n.y * h.x, n.z * h.x + (n.z > 0 ? h.z : -h.z)});
      });
      const int rings = static_cast<int>(2.0f * h.z / step_m);
      const int around = std::max(8, static_cast<int>(6.2832f * h.x / step_m));
      for (int i = 0; i < rings; ++i)
        for (int j = 0; j < around; ++j) {
          const float turn = 6.28318531f * static_cast<float>(j) / static_cast<float>(around);
          const float z = h.z * ((2.0f * static_cast<float>(i) + 1.0f) / static_cast<float>(rings) - 1.0f);
          put(Vec3{h.x * std::cos(turn), h.x * std::sin(turn), z});
        }
      break;
    }
  }
}

/// Radius of a sphere about the middle of a solid that holds all of it.
float reach_m(const Shape& shape) {
  const Vec3 h = shape.half_m;
  return (shape.kind == Kind::capsule ? h.x + h.z : norm(h)) + kHiddenM;
}

/// What can hide a part of the shape number `own`.
std::vector<const Shape*> near_to(const World& world, size_t own) {
  const Shape& shape = world.shapes[own];
  std::vector<const Shape*> near;
  for (size_t i = 0; i < world.shapes.size(); ++i) {
    const Shape& other = world.shapes[i];
    if (i == own || other.moving) continue;
    const float apart_m = norm(shape.T_world_local.translation - other.T_world_local.translation);
    if (apart_m < reach_m(shape) + reach_m(other)) near.push_back(&other);
  }
  return near;
}

/// Of many shapes those that reach the metre of space in which one asks; points of a face come row by row, so
/// that one asks the same metre again and again.
class NearPoint {
 public:
  explicit NearPoint(std::vector<const Shape*> all) : all_(std::move(all)) {}

  const std::vector<const Shape*>& at(Vec3 p_world) {
    const Vec3 middle = {std::floor(p_world.x) + 0.5f, std::floor(p_world.y) + 0.5f,
                         std::floor(p_world.z) + 0.5f};
    if (found_ && norm(middle - middle_) < 0.5f) return near_;
    constexpr float kHalfDiagonalM = 0.8661f;
    near_.clear();
    for (const Shape* shape : all_)
      if (shape->kind == Kind::room ||
          norm(shape->T_world_local.translation - middle) < reach_m(*shape) + kHalfDiagonalM)
        near_.push_back(shape);
    middle_ = middle;
    found_ = true;
    return near_;
  }

 private:
  std::vector<const Shape*> all_, near_;
  Vec3 middle_;
  bool found_ = false;
};

bool hidden(const std::vector<const Shape*>& others, Vec3 p_world) {
  for (const Shape* other : others) {
    const Vec3 from_centre = p_world - other->T_world_local.translation;
    const float reach = reach_m(*other);
    if (other->kind != Kind::room && dot(from_centre, from_centre) > reach * reach) continue;
    if (distance_m(*other, p_world) < kHiddenM) return true;
  }
  return false;
}

}  // namespace

std::vector<Vec3> sample_still_surface(const World& world, float step_m) {
  std::vector<Vec3> points;
  for (size_t i = 0; i < world.shapes.size(); ++i) {
    const Shape& shape = world.shapes[i];
    if (shape.moving) continue;
    NearPoint others(near_to(world, i));
    sample_shape(shape, step_m, [&](Vec3 p_local) {
      const Vec3 p = shape.T_world_local * p_local;
      if (!hidden(others.at(p), p)) points.push_back(p);
    });
  }
  return points;
}

}  // namespace stillmap::synthetic
