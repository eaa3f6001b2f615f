#pragma once

// A small engine that has seen the corner scene, and looks at it or away from it.

#include <memory>
#include <vector>

#include "kernels/engine.hpp"
#include "tests/support/corner_scene.hpp"
#include "tests/support/corner_states.hpp"

namespace stillmap::test {

inline EngineParams small_archive_params(int32_t pool_blocks = 6000) {
  EngineParams p;
  p.camera.k = corner_camera(120);
  p.map.voxel_m = 0.02f;
  p.map.truncation_m = 0.1f;
  p.map.free_space = FreeSpace::hierarchical;
  p.map.pool_blocks = pool_blocks;
  p.map.mesh_min_weight = 1;
  p.map.mesh_min_surface = 0;
  p.threads = 1;
  p.fetch_m = 0.1f;
  return p;
}

class MappedCorner {
 public:
  explicit MappedCorner(const EngineParams& params = small_archive_params())
      : engine(make_cpu_engine(params)), k_(params.camera.k) {
    for (int n = 0; n < 3; ++n) look(Se3d{});
  }

  void prepare(const Se3d& T_map_cam) {
    const CornerView view({}, k_, T_map_cam);
    engine->prepare({view.image(view.depth_raw), view.image(view.colour)});
  }
  void look(const Se3d& T_map_cam) {
    prepare(T_map_cam);
    engine->integrate(cast<float>(T_map_cam));
  }
  /// One frame from far outside of the scene, at a wall that nobody saw before: the corner is out of view.
  void look_away() {
    const Se3d T = exp(Twistd{{0, 0, -20}, {0, 0, 0}});
    const CornerView view({}, k_, Se3d{});
    engine->prepare({view.image(view.depth_raw), view.image(view.colour)});
    engine->integrate(cast<float>(T));
  }
  std::vector<PointState> states() const { return states_in_corner(*engine, 0.053f); }

  std::unique_ptr<Engine> engine;

 private:
  Intrinsics k_;
};

}  // namespace stillmap::test
