#pragma once

// Raw images to metres and luminance, one pixel at a time (paper sections III-B, III-E).

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/view.hpp"
#include "kernels/map/voxel.hpp"
#include "kernels/params.hpp"
#include "kernels/prepare/depth_bias.hpp"

namespace stillmap {

constexpr uint16_t kRawFar = 65535;  ///< like 0: no measurement

/// Metres, 0 when there is no usable measurement. Farther than depth.max_m stays: such a ray still sees free
/// space.
STILLMAP_HD float metres_from_raw(uint16_t raw, float m_per_unit, float min_m) {
  const float z_m = static_cast<float>(raw) * m_per_unit;
  return (raw == 0) | (raw == kRawFar) | (z_m < min_m) ? 0.0f : z_m;
}

/// The same with the camera's bias taken out. @param max_m up to which the bias is known
STILLMAP_HD float metres_from_raw(uint16_t raw, float m_per_unit, float min_m, const DepthBias& bias,
                                  float max_m) {
  const float z_m = bias.corrected(static_cast<float>(raw) * m_per_unit, max_m);
  return (raw == 0) | (raw == kRawFar) | !(z_m >= min_m) ? 0.0f : z_m;
}

/// Bilinear colour at (u, v); black outside.                            test: prepare_test
STILLMAP_HD Rgb8 bilinear(ImageView<const Rgb8> image, Pixel p) {
  if (!(p.u >= 0.0f && p.v >= 0.0f && p.u <= static_cast<float>(image.cols - 1) &&
        p.v <= static_cast<float>(image.rows - 1)))
    return {};
  const int32_t c = static_cast<int32_t>(p.u), r = static_cast<int32_t>(p.v);
  const int32_t c1 = c + 1 < image.cols ? c + 1 : c, r1 = r + 1 < image.rows ? r + 1 : r;
  const float fu = p.u - static_cast<float>(c), fv = p.v - static_cast<float>(r);
  const Rgb8 a = image.at(r, c), b = image.at(r, c1), d = image.at(r1, c), e = image.at(r1, c1);
  const auto mix = [&](uint8_t v00, uint8_t v01, uint8_t v10, uint8_t v11) {
    const float top = static_cast<float>(v00) + fu * (static_cast<float>(v01) - static_cast<float>(v00));
    const float low = static_cast<float>(v10) + fu * (static_cast<float>(v11) - static_cast<float>(v10));
    return clamp_to_byte(top + fv * (low - top));
  };
  return {mix(a.r, b.r, d.r, e.r), mix(a.g, b.g, d.g, e.g), mix(a.b, b.b, d.b, e.b)};
}

/// Writes one pixel of the prepared images. Depth is resampled by nearest, never blended; colour bilinear.
struct PreparePass {
  ImageView<const uint16_t> depth_raw;
  ImageView<const Rgb8> colour_raw;
  ImageView<float> depth_m;
  ImageView<LumaChroma> luma_chroma_image;
  ImageView<Rgb8> colour;
  ImageView<const Pixel>
      source_pixel;  ///< where an undistorted pixel lies in the raw image; no data: same place
  float m_per_unit = 0;
  float min_m = 0;
  float max_m = 0;
  DepthBias bias = {};
  bool biased = false;  ///< whether `bias` is anything

  STILLMAP_HD float metres(uint16_t raw) const {
    return biased ? metres_from_raw(raw, m_per_unit, min_m, bias, max_m)
                  : metres_from_raw(raw, m_per_unit, min_m);
  }

  /// @return true when the depth lies in [min_m, max_m]
  STILLMAP_HD bool operator()(int32_t row, int32_t col) const {
    uint16_t raw = 0;
    Rgb8 rgb;
    if (source_pixel.data) {
      const Pixel p = source_pixel.at(row, col);
      const int32_t c = static_cast<int32_t>(floorf(p.u + 0.5f)),
                    r = static_cast<int32_t>(floorf(p.v + 0.5f));
      if (depth_raw.contains(r, c)) raw = depth_raw.at(r, c);
      rgb = bilinear(colour_raw, p);
    } else {
      raw = depth_raw.at(row, col);
      rgb = colour_raw.at(row, col);
    }
    const float z_m = metres(raw);
    depth_m.at(row, col) = z_m;
    colour.at(row, col) = rgb;
    luma_chroma_image.at(row, col) = luma_chroma(rgb);
    return z_m > 0.0f && z_m <= max_m;
  }
};

}  // namespace stillmap
