#include "drivers/camera/depth_registration.hpp"

#include "kernels/backend/cpu/loops.hpp"

namespace stillmap {
namespace {

/// The ideal pixel that the lens moves to `seen`: fixed-point iteration, which ends where no lens that can be
/// used still changes anything.
Pixel undistorted(const CameraModel& camera, Pixel seen) {
  constexpr int kSteps = 20;
  Pixel ideal = seen;
  for (int step = 0; step < kSteps && !camera.distortion.none(); ++step) {
    const Pixel moved = distort(camera, ideal);
    ideal.u += seen.u - moved.u;
    ideal.v += seen.v - moved.v;
  }
  return ideal;
}

}  // namespace

DepthRegistration::DepthRegistration(const DepthCamera& depth, const CameraModel& colour, float units_per_m,
                                     const CpuLoops* loops)
    : depth_k_(depth.model.k), loops_(loops ? *loops : best_loops()) {
  const Se3 T = cast<float>(depth.T_colour_depth);
  const size_t pixels = static_cast<size_t>(depth_k_.width) * static_cast<size_t>(depth_k_.height);
  for (std::vector<float>* axis : {&ray_x_, &ray_y_, &ray_z_}) axis->reserve(pixels);
  for (int32_t row = 0; row < depth_k_.height; ++row)
    for (int32_t col = 0; col < depth_k_.width; ++col) {
      const Pixel p = undistorted(depth.model, {static_cast<float>(col), static_cast<float>(row)});
      const Vec3 ray = T.rotation * unproject(depth_k_, p.u, p.v, 1.0f);
      ray_x_.push_back(ray.x);
      ray_y_.push_back(ray.y);
      ray_z_.push_back(ray.z);
    }
  const auto image = [&](const std::vector<float>& axis) {
    return ImageView<const float>{axis.data(), depth_k_.height, depth_k_.width, depth_k_.width};
  };
  pass_ = {image(ray_x_),
           image(ray_y_),
           image(ray_z_),
           T.translation,
           colour,
           units_per_m,
           0.5f * colour.k.fx / depth.model.k.fx,
           0.5f * colour.k.fy / depth.model.k.fy};
}

void DepthRegistration::run(ImageView<const uint16_t> depth_raw, ImageView<uint16_t> registered_raw) const {
  loops_.register_depth(pass_, depth_raw, registered_raw);
}

}  // namespace stillmap
