#include "kernels/backend/cpu/raycast.hpp"

#include <algorithm>

namespace stillmap {
namespace {

/// Edge of the squares of pixels that are cast together: their rays share blocks and cache lines.
constexpr int32_t kSquarePx = 8;

}  // namespace

void raycast_rows(const RaycastPass& pass, int32_t first_row, int32_t last_row) {
  RayBlocks blocks;
  for (int32_t top = first_row; top < last_row; top += kSquarePx)
    for (int32_t left = 0; left < pass.depth_m.cols; left += kSquarePx) {
      const int32_t bottom = std::min(top + kSquarePx, last_row);
      const int32_t right = std::min(left + kSquarePx, pass.depth_m.cols);
      for (int32_t r = top; r < bottom; ++r)
        for (int32_t c = left; c < right; ++c) pass(r, c, blocks);
    }
}

}  // namespace stillmap
