#pragma once

#include <cstdint>

#include "kernels/base/hd.hpp"
#include "kernels/base/lane.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

constexpr int32_t kBlockEdge = 8;  ///< voxels along an edge of a block
constexpr int32_t kBlockVoxels = kBlockEdge * kBlockEdge * kBlockEdge;

/// What tracking reads: signed distance and luminance in one 32-bit word, so that one load a corner gives
/// both.
struct VoxelSurface {
  int16_t sdf = INT16_MIN;  ///< tau / 32767 each; kSdfUnobserved: never seen
  uint16_t luma = 0;  ///< 0..65280 for 0..255 (256 each); of no meaning while the voxel was only ever free
};

/// What only fusion and the mesh need.
struct VoxelRecord {
  uint8_t weight = 0;         ///< observations in the distance, capped
  uint8_t colour_weight = 0;  ///< observations in the colour, capped
  uint8_t cb = 128;  ///< blue and red chroma of ITU-R BT.709, 128: none. With `luma` they give the colour
  uint8_t cr = 128;
};

constexpr int16_t kSdfUnobserved = INT16_MIN;
constexpr int16_t kSdfMax = INT16_MAX;  ///< the truncation distance: free space
constexpr float kLumaScale = 65280.0f;  ///< luma units for intensity 1

/// 8x8x8 voxels, x fastest. Distance and luminance lie apart from the rest: tracking touches half of the
/// memory.
struct VoxelBlock {
  VoxelSurface surface[kBlockVoxels];
  VoxelRecord record[kBlockVoxels];
};
static_assert(sizeof(VoxelBlock) == 4096, "8 bytes a voxel, one page a block");

/// Index of a voxel within its block; x, y, z in 0..7.
STILLMAP_HD int32_t voxel_index(int32_t x, int32_t y, int32_t z) {
  return x + kBlockEdge * (y + kBlockEdge * z);
}

/// Luminance of the paper (section III-B), 0..1.
template <class F>
STILLMAP_HD F luminance(F r, F g, F b) {
  return (F(0.2126f) * r + F(0.7152f) * g + F(0.0722f) * b) * F(1.0f / 255.0f);
}
STILLMAP_HD float luminance(Rgb8 c) {
  return luminance(static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b));
}

/// Colour of a prepared pixel, in the units of the voxels.
struct LumaChroma {
  uint16_t luma = 0;  ///< kLumaScale is white
  uint8_t cb = 128, cr = 128;
};
static_assert(sizeof(LumaChroma) == 4, "one 32-bit load");

STILLMAP_HD uint8_t clamp_to_byte(float x) {
  return static_cast<uint8_t>(x < 0.0f ? 0.0f : x > 255.0f ? 255.0f : x + 0.5f);
}

/// From red, green and blue, 0..255. @return the words of a LumaChroma: luma, cb << 16, cr << 24
template <class F>
STILLMAP_HD IntOf<F> luma_chroma_word(F r, F g, F b) {
  const F half = F(0.5f), y = luminance(r, g, b);
  const auto byte = [&](F x) { return to_int(min_of(max_of(x, F(0.0f)), F(255.0f)) + half); };
  const auto chroma = [&](F x, float scale) { return byte(F(128.0f) + (x - F(255.0f) * y) * F(scale)); };
  return to_int(y * F(kLumaScale) + half) | (chroma(b, 1.0f / 1.8556f) << 16) |
         (chroma(r, 1.0f / 1.5748f) << 24);
}
STILLMAP_HD LumaChroma luma_chroma(Rgb8 c) {
  const auto word = static_cast<uint32_t>(
      luma_chroma_word(static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)));
  return {static_cast<uint16_t>(word), static_cast<uint8_t>(word >> 16), static_cast<uint8_t>(word >> 24)};
}

/// Colour of a voxel from luminance (0..1) and chroma (bytes about 128).
STILLMAP_HD Rgb8 colour_from(float luma, float cb, float cr) {
  const float y = 255.0f * luma;
  const float r = y + 1.5748f * (cr - 128.0f);
  const float b = y + 1.8556f * (cb - 128.0f);
  const float g = (y - 0.2126f * r - 0.0722f * b) * (1.0f / 0.7152f);
  return {clamp_to_byte(r), clamp_to_byte(g), clamp_to_byte(b)};
}

}  // namespace stillmap
