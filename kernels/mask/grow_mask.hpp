#pragma once

// Erosion, depth-aware flood fill and dilation (paper section III-C, Algorithm 1). Bounded, without
// recursion.

#include <cstdint>

#include "kernels/base/view.hpp"

namespace stillmap {

/// Square erosion, rows first and columns of the result after: a pixel stays when every pixel within
/// `radius_px` rows and columns is set; outside counts as set. Each call does the rows or columns [first,
/// last).
/// @param out same size as `in`, not the same memory                       test: mask_test
void erode_rows(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_row,
                int32_t last_row);
void erode_columns(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_col,
                   int32_t last_col);
/// Square dilation: a pixel is set when any pixel within `radius_px` rows and columns is.   test: mask_test
void dilate_rows(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_row,
                 int32_t last_row);
void dilate_columns(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_col,
                    int32_t last_col);

/// Algorithm 1: grows the set pixels of `mask` to 4-neighbours n of p with |D(p) - D(n)| < theta D(p).
/// Pixels without depth neither grow nor are reached.                     test: mask_test
/// @param queue room for one entry a pixel: each pixel enters at most once
void flood_fill(ImageView<uint8_t> mask, ImageView<const float> depth_m, float theta, View<int32_t> queue);

}  // namespace stillmap
