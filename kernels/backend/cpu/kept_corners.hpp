#pragma once

#include <algorithm>
#include <cstdint>

#include "kernels/base/view.hpp"
#include "kernels/map/block_key.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

/// The eight voxels around each point of a registration, kept from pass to pass: between two passes the pose
/// moves by less than a voxel, so that most points stay between the same ones and need not look them up
/// again. One entry a point of the finest level. Of one map: to be forgotten when it changes.
struct KeptCorners {
  struct Corners {
    VoxelSurface voxel[8];
  };
  ImageView<uint64_t> cell;  ///< cell_word of the point when its voxels were read; kNothing: not yet
  ImageView<Corners> corners;
  int32_t step = 1;  ///< pixels from one entry to the next; passes over every n-th entry may use it, too

  static constexpr uint64_t kNothing = 0, kRead = 1ull << 62, kKnown = 1ull << 63;

  /// A cell of the map in one word; those that share one are 10 km apart.
  static uint64_t cell_word(Int3 cell) {
    constexpr uint64_t k21 = (1u << 21) - 1, k20 = (1u << 20) - 1;
    const auto bits = [](int32_t x, uint64_t mask) { return static_cast<uint64_t>(x) & mask; };
    return bits(cell.x, k21) | bits(cell.y, k21) << 21 | bits(cell.z, k20) << 42 | kRead;
  }
  void forget_rows(int32_t first, int32_t last) const {
    std::fill(cell.row(first), cell.row(first) + (last - first) * cell.pitch, kNothing);
  }
};

}  // namespace stillmap
