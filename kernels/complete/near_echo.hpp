#pragma once

// What the sonar says about a frame whose nearest things the camera cannot measure (paper III-E).

#include "kernels/base/vec.hpp"

namespace stillmap {

/// A reading nearer than the camera can measure. Something stands in the sonar's cone, at `range_m` or
/// farther but not beyond `until_m`, where the camera would measure it.
struct NearEcho {
  Vec3 place_cam;           ///< of the sonar, metres
  Vec3 axis_cam;            ///< where it looks, unit length
  float cos_half_beam = 1;  ///< of the angle between the axis and the rim of its cone
  float range_m = 0;        ///< 0: there is no such reading
  float until_m = 0;        ///< >= range_m, from the sonar

  /// Whether the camera's ray passes through what the sonar may have heard.
  /// @param ray_cam any length, from the camera's centre                              test: near_echo_test
  STILLMAP_HD bool may_be_on(Vec3 ray_cam) const {
    return range_m > 0.0f && (in_cone_at(ray_cam, range_m) || in_cone_at(ray_cam, until_m));
  }

 private:
  /// Where the ray is `far_m` from the sonar: whether that lies in the cone.
  STILLMAP_HD bool in_cone_at(Vec3 ray_cam, float far_m) const {
    const float a = dot(ray_cam, ray_cam), b = dot(ray_cam, place_cam);
    const float c = dot(place_cam, place_cam) - far_m * far_m;
    // Nearer to the sonar than the camera is: only the direction is left to go by.
    if (c >= 0.0f) return dot(ray_cam, axis_cam) >= cos_half_beam * sqrtf(a);
    const float t = (b + sqrtf(b * b - a * c)) / a;
    return dot(t * ray_cam - place_cam, axis_cam) >= cos_half_beam * far_m;
  }
};

}  // namespace stillmap
