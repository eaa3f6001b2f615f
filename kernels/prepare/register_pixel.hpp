#pragma once

// Raw depth of one camera as another camera would see it, one pixel at a time.

#include <cstdint>

#include "kernels/base/lane.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/view.hpp"
#include "kernels/prepare/prepare_pixel.hpp"

namespace stillmap {

/// Pixels of the colour image that one depth pixel covers.
/// @tparam I an integer, or lanes of them
template <class I>
struct LandedPixel {
  I first;   ///< the upper left one, row * pitch + column: inside the image, also where it covers none
  I extent;  ///< rows + 256 columns, at most 4 of each
  I raw;     ///< depth from the colour camera; kRawFar: covers nothing
};

/// Of several depth pixels that cover a pixel the nearest stays; kRawFar where there was none.
STILLMAP_HD void put_nearest(const LandedPixel<int32_t>& landed, ImageView<uint16_t> registered_raw) {
  const auto nearest = [raw = static_cast<uint16_t>(landed.raw)](uint16_t& pixel) {
    pixel = raw < pixel ? raw : pixel;
  };
  uint16_t* at = registered_raw.data + landed.first;
  constexpr int32_t kOne = 1 + 256;
  if ((landed.extent & ~kOne) == 0) return nearest(*at);  // most; also what covers nothing: no branch
  const int32_t rows = landed.extent & 255, cols = landed.extent >> 8;
  for (int32_t r = 0; r < rows; ++r, at += registered_raw.pitch)
    for (int32_t c = 0; c < cols; ++c) nearest(at[c]);
}

/// Lands depth pixels in the colour image; over a number type (base/lane.hpp). test: depth_registration_test
struct RegisterPass {
  ImageView<const float> ray_x, ray_y, ray_z;  ///< of each depth pixel at a depth of 1, colour camera's axes
  Vec3 t_colour_depth_m;
  CameraModel colour;
  float units_per_m = 1;
  float half_cols = 0, half_rows = 0;  ///< of what a pixel covers where both cameras are as far away

  /// @tparam kBent whether the colour camera's lens has a distortion
  /// @param depth_raw 0 and 65535 are invalid  @param pitch of the registered image
  template <bool kBent, class F>
  STILLMAP_HD LandedPixel<IntOf<F>> land(F ray_x_1, F ray_y_1, F ray_z_1, IntOf<F> depth_raw,
                                         int32_t pitch) const {
    using I = IntOf<F>;
    const F z_m = to_float(depth_raw) * F(1.0f / units_per_m);
    const F x_m = z_m * ray_x_1 + F(t_colour_depth_m.x), y_m = z_m * ray_y_1 + F(t_colour_depth_m.y),
            new_z_m = z_m * ray_z_1 + F(t_colour_depth_m.z);
    const F new_raw = new_z_m * F(units_per_m) + F(0.5f);
    const MaskOf<F> seen = (depth_raw != I(0)) & (depth_raw != I(kRawFar)) & (new_raw >= F(1.0f)) &
                           (new_raw < F(static_cast<float>(kRawFar)));
    const F per_z = F(1.0f) / select(seen, new_z_m, F(1.0f));
    F u = F(colour.k.fx) * x_m * per_z + F(colour.k.cx), v = F(colour.k.fy) * y_m * per_z + F(colour.k.cy);
    if constexpr (kBent) distort(colour, u, v);
    const F nearer = z_m * per_z;  // seen from nearer it is larger
    const F half_u = half(half_cols, nearer), half_v = half(half_rows, nearer);
    const I height = I(colour.k.height), width = I(colour.k.width);
    const I row = cut_up(v - half_v, height), rows = cut_up(v + half_v, height) - row,
            col = cut_up(u - half_u, width), cols = cut_up(u + half_u, width) - col;
    const MaskOf<F> covers = seen & (rows > I(0)) & (cols > I(0));
    return {select(covers, row * I(pitch) + col, I(0)), select(covers, rows + (cols << 8), I(0)),
            select(covers, to_int(select(seen, new_raw, F(0.0f))), I(kRawFar))};
  }

 private:
  /// Something that is close to the colour camera alone covers no more than four pixels across.
  template <class F>
  STILLMAP_HD static F half(float far, F nearer) {
    return min_of(F(far) * nearer, F(2.0f));
  }
  /// The whole number at or above `x`, cut to [0, size].
  template <class F>
  STILLMAP_HD static IntOf<F> cut_up(F x, IntOf<F> size) {
    x = min_of(max_of(x, F(0.0f)), to_float(size));  // the maximum also of what is no number
    const IntOf<F> down = to_int(x);
    return select(to_float(down) < x, down + IntOf<F>(1), down);
  }
};

}  // namespace stillmap
