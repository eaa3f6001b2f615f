#include "kernels/mask/grow_mask.hpp"

#include <cmath>

#include "kernels/mask/residual_mask.hpp"

namespace stillmap {
namespace {

/// Sliding window of 2 radius + 1 pixels along a line: sets `out` where the number of set pixels in the
/// window (cut at the borders) is the window's size (erosion) or above zero (dilation).
template <bool kErode>
void slide(const uint8_t* in, uint8_t* out, int32_t length, int32_t stride, int32_t radius) {
  int32_t set = 0;
  for (int32_t i = 0; i < radius && i < length; ++i) set += in[i * stride] != 0;
  for (int32_t i = 0; i < length; ++i) {
    if (i + radius < length) set += in[(i + radius) * stride] != 0;
    if (i - radius - 1 >= 0) set -= in[(i - radius - 1) * stride] != 0;
    const int32_t first = i - radius < 0 ? 0 : i - radius;
    const int32_t last = i + radius >= length ? length - 1 : i + radius;
    const bool on = kErode ? set == last - first + 1 : set > 0;
    out[i * stride] = on ? kMasked : uint8_t{0};
  }
}

}  // namespace

void erode_rows(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_row,
                int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r) slide<true>(in.row(r), out.row(r), in.cols, 1, radius_px);
}
void erode_columns(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_col,
                   int32_t last_col) {
  for (int32_t c = first_col; c < last_col; ++c)
    slide<true>(in.data + c, out.data + c, in.rows, in.pitch, radius_px);
}
void dilate_rows(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_row,
                 int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r) slide<false>(in.row(r), out.row(r), in.cols, 1, radius_px);
}
void dilate_columns(ImageView<const uint8_t> in, ImageView<uint8_t> out, int32_t radius_px, int32_t first_col,
                    int32_t last_col) {
  for (int32_t c = first_col; c < last_col; ++c)
    slide<false>(in.data + c, out.data + c, in.rows, in.pitch, radius_px);
}

void flood_fill(ImageView<uint8_t> mask, ImageView<const float> depth_m, float theta, View<int32_t> queue) {
  uint32_t tail = 0;
  for (int32_t r = 0; r < mask.rows; ++r)
    for (int32_t c = 0; c < mask.cols; ++c)
      if (mask.at(r, c)) queue[tail++] = r * mask.cols + c;
  for (uint32_t head = 0; head < tail; ++head) {
    const int32_t r = queue[head] / mask.cols, c = queue[head] % mask.cols;
    const float z_m = depth_m.at(r, c);
    if (z_m <= 0.0f) continue;
    const auto visit = [&](int32_t nr, int32_t nc) {
      if (!mask.contains(nr, nc) || mask.at(nr, nc)) return;
      const float neighbour_m = depth_m.at(nr, nc);
      if (neighbour_m <= 0.0f || !(std::fabs(z_m - neighbour_m) < theta * z_m)) return;
      mask.at(nr, nc) = kMasked;
      queue[tail++] = nr * mask.cols + nc;
    };
    visit(r, c - 1);
    visit(r, c + 1);
    visit(r - 1, c);
    visit(r + 1, c);
  }
}

}  // namespace stillmap
