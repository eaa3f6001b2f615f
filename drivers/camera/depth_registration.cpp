#include "drivers/camera/depth_registration.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/prepare/prepare_pixel.hpp"

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

/// Pixels whose centre lies in [middle - half, middle + half), cut to the image and to kMost.
struct Covered {
  int32_t first, last;

  Covered(float middle, float half, int32_t size) {
    constexpr float kMost = 4;  // something that close to the colour camera alone covers no more
    half = std::min(half, 0.5f * kMost);
    first = static_cast<int32_t>(std::ceil(std::max(middle - half, -1.0f)));
    last = static_cast<int32_t>(std::ceil(std::min(middle + half, static_cast<float>(size)))) - 1;
    first = std::max(first, 0);
    last = std::min(last, size - 1);
  }
};

}  // namespace

DepthRegistration::DepthRegistration(const DepthCamera& depth, const CameraModel& colour, float units_per_m)
    : depth_k_(depth.model.k),
      colour_(colour),
      units_per_m_(units_per_m),
      t_colour_depth_m_(cast<float>(depth.T_colour_depth).translation),
      footprint_{0.5f * colour.k.fx / depth.model.k.fx, 0.5f * colour.k.fy / depth.model.k.fy} {
  const Se3 T = cast<float>(depth.T_colour_depth);
  ray_.reserve(static_cast<size_t>(depth_k_.width) * static_cast<size_t>(depth_k_.height));
  for (int32_t row = 0; row < depth_k_.height; ++row)
    for (int32_t col = 0; col < depth_k_.width; ++col) {
      const Pixel p = undistorted(depth.model, {static_cast<float>(col), static_cast<float>(row)});
      ray_.push_back(T.rotation * unproject(depth_k_, p.u, p.v, 1.0f));
    }
}

void DepthRegistration::run(ImageView<const uint16_t> depth_raw, ImageView<uint16_t> registered_raw) const {
  for (int32_t row = 0; row < registered_raw.rows; ++row)
    std::fill_n(registered_raw.row(row), registered_raw.cols, uint16_t{0});
  const float m_per_unit = 1.0f / units_per_m_;
  const Vec3* ray = ray_.data();
  for (int32_t row = 0; row < depth_raw.rows; ++row)
    for (int32_t col = 0; col < depth_raw.cols; ++col, ++ray) {
      const uint16_t raw = depth_raw.at(row, col);
      if (raw == 0 || raw == kRawFar) continue;
      const float z_m = static_cast<float>(raw) * m_per_unit;
      const Vec3 p_colour = z_m * *ray + t_colour_depth_m_;
      const float new_raw = p_colour.z * units_per_m_ + 0.5f;
      if (!(new_raw >= 1.0f && new_raw < static_cast<float>(kRawFar))) continue;
      const auto value = static_cast<uint16_t>(new_raw);
      Pixel at = project(colour_.k, p_colour);
      if (!colour_.distortion.none()) at = distort(colour_, at);
      const float nearer = z_m / p_colour.z;  // seen from nearer it is larger
      const Covered cols(at.u, footprint_.half_cols * nearer, registered_raw.cols);
      const Covered rows(at.v, footprint_.half_rows * nearer, registered_raw.rows);
      for (int32_t r = rows.first; r <= rows.last; ++r)
        for (int32_t c = cols.first; c <= cols.last; ++c) {
          uint16_t& pixel = registered_raw.at(r, c);
          if (pixel == 0 || value < pixel) pixel = value;
        }
    }
}

}  // namespace stillmap
