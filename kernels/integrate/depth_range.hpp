#pragma once

// Smallest and largest static depth of image tiles, level over level: tells what a whole block can see at
// once.

#include <cstdint>

#include "kernels/base/view.hpp"

namespace stillmap {

struct DepthRange {
  float min_m = 0;              ///< 0 when any pixel has no static measurement
  float max_m = 0;              ///< 0 when no pixel has one
  float nearest_m = kNoDepthM;  ///< of those that have one

  static constexpr float kNoDepthM = 1e30f;
};

STILLMAP_HD DepthRange range_of(float z_m) {
  return {z_m, z_m, z_m > 0.0f ? z_m : DepthRange::kNoDepthM};
}
STILLMAP_HD DepthRange merged(DepthRange a, DepthRange b) {
  return {a.min_m < b.min_m ? a.min_m : b.min_m, a.max_m > b.max_m ? a.max_m : b.max_m,
          a.nearest_m < b.nearest_m ? a.nearest_m : b.nearest_m};
}

constexpr int32_t kTilePx = 8;      ///< edge of a tile of the finest level
constexpr int32_t kMaxLevels = 12;  ///< 8 px * 2^11 covers any image

/// Level 0 has tiles of 8x8 pixels, each further level merges 2x2.
struct DepthRangePyramid {
  ImageView<DepthRange> level[kMaxLevels];
  int32_t levels = 0;
  int32_t image_rows = 0, image_cols = 0;

  /// Range over the pixel rectangle [row0, row1] x [col0, col1] (inside the image), from at most `across` + 1
  /// tiles each way: it may see a little more than the rectangle.                 test: depth_range_test
  STILLMAP_HD DepthRange query(int32_t row0, int32_t row1, int32_t col0, int32_t col1,
                               int32_t across = 2) const {
    const int32_t rows = row1 - row0, cols = col1 - col0;
    const int32_t extent = rows > cols ? rows : cols;
    int32_t l = 0;
    while (l + 1 < levels && extent >= (kTilePx * across) << l) ++l;
    const int32_t shift = l + 3;
    DepthRange range = level[l].at(row0 >> shift, col0 >> shift);
    for (int32_t r = row0 >> shift; r <= row1 >> shift; ++r)
      for (int32_t c = col0 >> shift; c <= col1 >> shift; ++c) range = merged(range, level[l].at(r, c));
    return range;
  }
};
static_assert(kTilePx == 1 << 3);

/// One tile of a level from the four (fewer at the border) of the level below it.
struct MergeRangesPass {
  ImageView<const DepthRange> fine;
  ImageView<DepthRange> coarse;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    const int32_t r1 = 2 * row + 1 < fine.rows ? 2 * row + 1 : fine.rows - 1,
                  c1 = 2 * col + 1 < fine.cols ? 2 * col + 1 : fine.cols - 1;
    coarse.at(row, col) = merged(merged(fine.at(2 * row, 2 * col), fine.at(2 * row, c1)),
                                 merged(fine.at(r1, 2 * col), fine.at(r1, c1)));
  }
};

/// Static depth (masked pixels removed) and its finest tiles.
struct StaticDepthPass {
  ImageView<const float> depth_m;
  ImageView<const uint8_t> mask;    ///< no data: nothing is masked
  bool through_movers = false;      ///< true: masked pixels still say what is free before them
  ImageView<float> static_depth_m;  ///< 0: no static measurement; below 0: minus the depth of a mover
  ImageView<DepthRange> tiles;

  STILLMAP_HD void operator()(int32_t tile_row, int32_t tile_col) const {
    DepthRange range = {DepthRange::kNoDepthM, 0.0f};
    const int32_t row_end = (tile_row + 1) * kTilePx < depth_m.rows ? (tile_row + 1) * kTilePx : depth_m.rows;
    const int32_t col_end = (tile_col + 1) * kTilePx < depth_m.cols ? (tile_col + 1) * kTilePx : depth_m.cols;
    for (int32_t r = tile_row * kTilePx; r < row_end; ++r)
      for (int32_t c = tile_col * kTilePx; c < col_end; ++c) {
        const bool masked = mask.data && mask.at(r, c);
        const float z_m = masked && !through_movers ? 0.0f : depth_m.at(r, c);
        static_depth_m.at(r, c) = masked ? -z_m : z_m;
        range = merged(range, range_of(z_m));
      }
    tiles.at(tile_row, tile_col) = range;
  }
};

}  // namespace stillmap
