#pragma once

#include "config/config.hpp"
#include "kernels/engine.hpp"

namespace stillmap {

/// What the engine needs, from the configuration and from what the source says of its camera.
/// config.camera, where set, wins over the source. @param bias of the source's depth
inline EngineParams engine_params(const Config& config, CameraModel camera, float depth_units_per_m,
                                  const DepthBias& bias = {}) {
  const CameraConfig& c = config.camera;
  if (c.fx > 0) {
    camera.k = {c.fx, c.fy, c.cx, c.cy, camera.k.width, camera.k.height};
    camera.distortion = {c.k1, c.k2, c.p1, c.p2, c.k3};
  }
  if (c.depth_units_per_m > 0) depth_units_per_m = c.depth_units_per_m;
  constexpr float kFetch_m = 0.5f;  // a quick turn goes so far while a group comes from the disk
  return {camera,
          depth_units_per_m,
          config.depth,
          config.track,
          config.mask,
          config.integrate,
          config.map,
          config.relocalise,
          config.runtime.threads,
          nullptr,
          config.archive.dir.empty() ? 0.0f : kFetch_m,
          bias};
}

}  // namespace stillmap
