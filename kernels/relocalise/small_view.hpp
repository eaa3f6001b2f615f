#pragma once

// A frame shrunk to about 80x60 and 40x30 pixels: what codes, the search of the pose and the check of a found
// pose look at. Cells across a depth edge have no depth: half a pixel there decides between two surfaces.

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/view.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

constexpr int32_t kSmallCols = 80;  ///< at most, of the finer small view
constexpr float kNoLuma = -1.0f;    ///< a cell that is masked
constexpr float kCellEdge = 0.1f;   ///< spread of the depths in a cell over their mean that makes it an edge
constexpr float kCellFilled = 0.25f;  ///< share of the pixels of a cell that must be usable

/// Depth (0: none) and luminance (0..1, kNoLuma: none) of the cells, row-major.
struct SmallView {
  ImageView<float> depth_m;
  ImageView<float> luma;
};

/// Edge of a cell in pixels of an image of this width.
STILLMAP_HD int32_t cell_px(int32_t width) {
  return (width + kSmallCols - 1) / kSmallCols;
}

/// One cell from the prepared images; masked pixels are left out.              test: small_view_test
struct ShrinkPass {
  ImageView<const float> depth_m;
  ImageView<const LumaChroma> colour;
  ImageView<const uint8_t> mask;  ///< 0: static
  int32_t px = 1;
  float max_m = 0;
  SmallView small;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    float sum_m = 0, nearest_m = 1e9f, farthest_m = 0, luma = 0;
    int32_t measured = 0, unmasked = 0;
    for (int32_t r = row * px; r < (row + 1) * px; ++r)
      for (int32_t c = col * px; c < (col + 1) * px; ++c) {
        if (mask.at(r, c)) continue;
        ++unmasked;
        luma += static_cast<float>(colour.at(r, c).luma);
        const float z_m = depth_m.at(r, c);
        if (!(z_m > 0.0f && z_m <= max_m)) continue;
        ++measured;
        sum_m += z_m;
        nearest_m = min_of(nearest_m, z_m);
        farthest_m = max_of(farthest_m, z_m);
      }
    const float least = kCellFilled * static_cast<float>(px * px);
    const float mean_m = measured > 0 ? sum_m / static_cast<float>(measured) : 0.0f;
    const bool plain = static_cast<float>(measured) >= least && farthest_m - nearest_m <= kCellEdge * mean_m;
    small.depth_m.at(row, col) = plain ? mean_m : 0.0f;
    small.luma.at(row, col) =
        static_cast<float>(unmasked) >= least ? luma / (kLumaScale * static_cast<float>(unmasked)) : kNoLuma;
  }
};

/// One cell of a view half as fine, from the four that lie in it.               test: small_view_test
struct HalvePass {
  SmallView fine, coarse;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    float sum_m = 0, nearest_m = 1e9f, farthest_m = 0, luma = 0;
    int32_t measured = 0, unmasked = 0;
    for (int32_t i = 0; i < 4; ++i) {
      const int32_t r = 2 * row + (i >> 1), c = 2 * col + (i & 1);
      const float z_m = fine.depth_m.at(r, c), l = fine.luma.at(r, c);
      if (z_m > 0.0f) {
        ++measured;
        sum_m += z_m;
        nearest_m = min_of(nearest_m, z_m);
        farthest_m = max_of(farthest_m, z_m);
      }
      if (l == kNoLuma) continue;
      ++unmasked;
      luma += l;
    }
    const float mean_m = measured > 0 ? sum_m / static_cast<float>(measured) : 0.0f;
    const bool plain = measured >= 2 && farthest_m - nearest_m <= kCellEdge * mean_m;
    coarse.depth_m.at(row, col) = plain ? mean_m : 0.0f;
    coarse.luma.at(row, col) = unmasked >= 2 ? luma / static_cast<float>(unmasked) : kNoLuma;
  }
};

}  // namespace stillmap
