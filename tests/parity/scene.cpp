#include "tests/parity/scene.hpp"

#include "drivers/synthetic/synthetic_source.hpp"

namespace stillmap::parity {

Result<Scene> render_scene(const std::string& name, int first, int count, const std::string& size) {
  Result<std::unique_ptr<FrameSource>> source = open_synthetic(name + ",size=" + size + ",seconds=10");
  if (!source) return Error{source.error()};
  const SourceInfo& info = (*source)->info();
  Scene scene{name, info.camera, info.depth_units_per_m, false, {}};
  const Intrinsics& k = info.camera.k;
  const auto pixels = static_cast<size_t>(k.width * k.height);
  (*source)->skip(static_cast<uint32_t>(first));
  Se3d T_world_first;
  for (int i = 0; i < count; ++i) {
    KeptFrame kept{std::vector<uint16_t>(pixels), std::vector<Rgb8>(pixels), {}};
    RgbdFrame frame;
    frame.depth_raw = {kept.depth_raw.data(), k.height, k.width, k.width};
    frame.colour = {kept.colour.data(), k.height, k.width, k.width};
    if ((*source)->next(frame, 1000) != Status::ok || !frame.truth_T_world_cam)
      return Error{"synthetic:" + name + " ended at frame " + std::to_string(i)};
    if (i == 0) T_world_first = *frame.truth_T_world_cam;
    kept.T_first_cam = inverse(T_world_first) * *frame.truth_T_world_cam;
    scene.frames.push_back(std::move(kept));
  }
  return scene;
}

}  // namespace stillmap::parity
