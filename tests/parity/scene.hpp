#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "kernels/engine.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap::parity {

/// One rendered frame, kept.
struct KeptFrame {
  std::vector<uint16_t> depth_raw;
  std::vector<Rgb8> colour;
  Se3d T_first_cam;  ///< truth, relative to the first frame
};

/// Some frames of a synthetic scene and the camera that took them.
struct Scene {
  std::string name;
  CameraModel camera;
  float depth_units_per_m = 0;
  bool movers = false;  ///< some of the frames show what moves
  std::vector<KeptFrame> frames;

  FrameView view(size_t i) const {
    const Intrinsics& k = camera.k;
    return {{frames[i].depth_raw.data(), k.height, k.width, k.width},
            {frames[i].colour.data(), k.height, k.width, k.width}};
  }
};

/// Renders `count` frames from frame `first` on. @param size "WxH"
Result<Scene> render_scene(const std::string& name, int first, int count,
                           const std::string& size = "320x240");

}  // namespace stillmap::parity
