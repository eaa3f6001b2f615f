#pragma once

#include <algorithm>
#include <vector>

#include "kernels/integrate/depth_range.hpp"

namespace stillmap::test {

/// Owner of a DepthRangePyramid and of the static depth under it.
class RangePyramid {
 public:
  RangePyramid(int32_t rows, int32_t cols) : static_depth_(static_cast<size_t>(rows * cols)) {
    view_.image_rows = rows;
    view_.image_cols = cols;
    int32_t r = (rows + kTilePx - 1) / kTilePx, c = (cols + kTilePx - 1) / kTilePx;
    tiles_.reserve(kMaxLevels);  // views point into it
    while (view_.levels < kMaxLevels) {
      tiles_.emplace_back(static_cast<size_t>(r * c));
      view_.level[view_.levels++] = {tiles_.back().data(), r, c, c};
      if (r == 1 && c == 1) break;
      r = (r + 1) / 2;
      c = (c + 1) / 2;
    }
  }
  RangePyramid(const RangePyramid&) = delete;
  RangePyramid& operator=(const RangePyramid&) = delete;

  /// @param mask without data: nothing is masked
  void build(ImageView<const float> depth_m, ImageView<const uint8_t> mask) {
    const StaticDepthPass pass{depth_m, mask, false, static_image(), view_.level[0]};
    for (int32_t r = 0; r < pass.tiles.rows; ++r)
      for (int32_t c = 0; c < pass.tiles.cols; ++c) pass(r, c);
    for (int32_t l = 1; l < view_.levels; ++l)
      for (int32_t r = 0; r < view_.level[l].rows; ++r)
        for (int32_t c = 0; c < view_.level[l].cols; ++c)
          view_.level[l].at(r, c) = merge_four(view_.level[l - 1], r, c);
  }

  const DepthRangePyramid& view() const { return view_; }
  ImageView<const float> static_depth() const {
    return {static_depth_.data(), view_.image_rows, view_.image_cols, view_.image_cols};
  }

 private:
  ImageView<float> static_image() {
    return {static_depth_.data(), view_.image_rows, view_.image_cols, view_.image_cols};
  }
  static DepthRange merge_four(ImageView<DepthRange> fine, int32_t r, int32_t c) {
    DepthRange all = fine.at(2 * r, 2 * c);
    for (int32_t y = 2 * r; y <= std::min(2 * r + 1, fine.rows - 1); ++y)
      for (int32_t x = 2 * c; x <= std::min(2 * c + 1, fine.cols - 1); ++x) all = merged(all, fine.at(y, x));
    return all;
  }

  std::vector<float> static_depth_;
  std::vector<std::vector<DepthRange>> tiles_;
  DepthRangePyramid view_;
};

}  // namespace stillmap::test
