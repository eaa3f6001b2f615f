#include "kernels/backend/cpu/raycast.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Edge of the squares of pixels that are cast together: their rays share blocks and cache lines.
constexpr int32_t kSquarePx = 8;
constexpr int32_t kRowsPerTask = 16;
constexpr uint32_t kBlocksPerTask = 256;
bool has_size(int32_t rows, int32_t cols, const Intrinsics& k) {
  return rows == k.height && cols == k.width;
}

/// @return views of the tiles of ranges, all empty
RayRanges empty_ranges(const Intrinsics& k, RayRange* memory) {
  const int32_t px = RayRanges::tile_px_for(k.height, k.width);
  const int32_t rows = (k.height + px - 1) / px, cols = (k.width + px - 1) / px;
  std::fill_n(memory, rows * cols, RayRange{});
  return {{memory, rows, cols, cols}, px};
}

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

uint64_t raycast_scratch_bytes() {
  return sizeof(RayRange) * RayRanges::kMaxEdge * RayRanges::kMaxEdge;
}

Status raycast(RaycastPass pass, View<uint8_t> scratch, ThreadPool& threads) {
  const Intrinsics& k = pass.k;
  if (!is_view(pass.T_map_cam, k) || !has_size(pass.depth_m.rows, pass.depth_m.cols, k) ||
      !has_size(pass.colour.rows, pass.colour.cols, k) || !scratch.data ||
      scratch.size < raycast_scratch_bytes())
    return Status::out_of_range;
  pass.ranges = empty_ranges(k, reinterpret_cast<RayRange*>(scratch.data));
  const RayRangesPass ranges{pass.map, k, inverse(pass.T_map_cam), pass.near_m, pass.far_m, pass.ranges};
  const uint32_t blocks = pass.map.block_keys.size;
  threads.for_each((blocks + kBlocksPerTask - 1) / kBlocksPerTask, [&](uint32_t task) {
    const uint32_t end = std::min((task + 1) * kBlocksPerTask, blocks);
    for (BlockId id = task * kBlocksPerTask; id < end; ++id) ranges(id);
  });
  threads.for_each(static_cast<uint32_t>((k.height + kRowsPerTask - 1) / kRowsPerTask), [&](uint32_t task) {
    const int32_t first = static_cast<int32_t>(task) * kRowsPerTask;
    raycast_rows(pass, first, std::min(first + kRowsPerTask, k.height));
  });
  return Status::ok;
}

}  // namespace stillmap
