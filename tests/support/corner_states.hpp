#pragma once

#include <vector>

#include "kernels/engine.hpp"

namespace stillmap::test {

/// What the map knows of a grid of points in the box that corner_camera() looks into.
inline std::vector<PointState> states_in_corner(const Engine& engine, float step_m) {
  std::vector<Vec3> points;
  for (float z = -0.2f; z < 2.4f; z += step_m)
    for (float y = -1.5f; y < 1.0f; y += step_m)
      for (float x = -2.0f; x < 1.2f; x += step_m) points.push_back({x, y, z});
  std::vector<PointState> states(points.size());
  const auto count = static_cast<uint32_t>(points.size());
  engine.look_up({points.data(), count}, {states.data(), count});
  return states;
}

}  // namespace stillmap::test
