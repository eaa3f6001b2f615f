#pragma once

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

constexpr uint8_t kMasked = 255;  ///< dynamic

/// Raw mask of the paper (section III-C): a pixel is suspect when its *squared* distance to the map exceeds
/// t = gamma tau^2, Eq. (5). Points without a value in the map are not suspect.
struct ResidualMaskPass {
  VolumeView map;
  ImageView<const float> depth_m;
  ImageView<uint8_t> suspect;
  Intrinsics k;
  Se3 T_map_cam;
  float max_m = 0;
  float threshold_m2 = 0;  ///< gamma tau^2

  template <class Cache>
  STILLMAP_HD void operator()(int32_t row, int32_t col, Cache& cache) const {
    const float z_m = depth_m.at(row, col);
    float sdf_m = 0;
    const bool measured =
        z_m > 0.0f && z_m <= max_m && sample_sdf(map, point_map(row, col, z_m), cache, sdf_m);
    suspect.at(row, col) = measured && sdf_m * sdf_m > threshold_m2 ? kMasked : uint8_t{0};
  }

 private:
  STILLMAP_HD Vec3 point_map(int32_t row, int32_t col, float z_m) const {
    return T_map_cam * unproject(k, static_cast<float>(col), static_cast<float>(row), z_m);
  }
};

}  // namespace stillmap
