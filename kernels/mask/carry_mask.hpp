#pragma once

#include "kernels/mask/cells.hpp"

namespace stillmap {

/// Carries one cell of the last frame's mask into this frame, onto the four cells around where it lies now:
/// no holes.                                                              test: parts_test
struct CarryMaskPass {
  ImageView<const float> depth_before_m;
  ImageView<const uint8_t> dynamic_before;
  Se3 T_now_before;
  CellGrid now;

  /// @param expect called with row, column and what is expected there at least
  template <class Expect>
  STILLMAP_HD void operator()(int32_t row, int32_t col, const Expect& expect) const {
    constexpr float kMovedM = 0.15f;  // towards or away from the camera since the last frame
    const float z_m = depth_before_m.at(row, col);
    const uint8_t dynamic = dynamic_before.at(row, col);
    if (!dynamic || z_m <= 0.0f) return;
    const Vec3 p = T_now_before * unproject(now.k, static_cast<float>(col), static_cast<float>(row), z_m);
    if (p.z < kNearestM) return;
    const Pixel at = project(now.k, p);
    const int32_t r0 = static_cast<int32_t>(floorf(at.v)), c0 = static_cast<int32_t>(floorf(at.u));
    for (int32_t i = 0; i < 4; ++i) {
      const int32_t r = r0 + (i >> 1), c = c0 + (i & 1);
      if (now.depth_m.contains(r, c) && fabsf(now.depth_m.at(r, c) - p.z) < kMovedM) expect(r, c, dynamic);
    }
  }
};

}  // namespace stillmap
