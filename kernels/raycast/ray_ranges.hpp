#pragma once

// Where along the rays of a tile of pixels a surface can be at all. A surface needs voxels below 0; so the
// blocks that hold some, projected into the view, bound the depths, and rays skip the free space before them.

#include <cmath>
#include <cstdint>
#include <cstring>

#include "kernels/base/atomic.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Depths of the surfaces of a tile as bits of floats above 0, which sort like integers. Empty: nearest above
/// farthest.
struct RayRange {
  static constexpr uint32_t kNothing = 0x7f800000u;  ///< infinity
  uint32_t nearest_bits = kNothing;
  uint32_t farthest_bits = 0;
};

STILLMAP_HD uint32_t bits_of(float x) {
  uint32_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits;
}
STILLMAP_HD float float_of(uint32_t bits) {
  float x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

/// The view cut into squares.
struct RayRanges {
  static constexpr int32_t kMaxEdge = 96;  ///< tiles along a side
  ImageView<RayRange> tiles;
  int32_t tile_px = 8;

  /// Smallest tiles, of whole eights of pixels, with which a view of this size has at most kMaxEdge.
  STILLMAP_HD static int32_t tile_px_for(int32_t rows, int32_t cols) {
    const int32_t longest = rows > cols ? rows : cols;
    return ((longest + kMaxEdge - 1) / kMaxEdge + 7) / 8 * 8;
  }
  STILLMAP_HD RayRange of_pixel(int32_t row, int32_t col) const {
    return tiles.at(row / tile_px, col / tile_px);
  }
};

/// Widens the ranges of the tiles in which one block can be seen. Whatever the order of the blocks, the
/// ranges come out the same.                                              test: ray_ranges_test
struct RayRangesPass {
  VolumeView map;
  Intrinsics k;
  Se3 T_cam_map;
  float near_m = 0;
  float far_m = 0;
  RayRanges ranges;

  /// @thread any, different blocks at the same time
  STILLMAP_HD void operator()(BlockId id) const {
    const BlockKey key = map.block_keys[id];
    if (key == kEmptyKey || map.settled_free[id]) return;
    const Int3 first = first_voxel(unpack(key));
    constexpr float middle = 0.5f * (kBlockEdge - 1);
    const Vec3 centre_cam =
        T_cam_map * (voxel_position(first, map.voxel_m) +
                     Vec3{middle * map.voxel_m, middle * map.voxel_m, middle * map.voxel_m});
    if (!may_be_seen(centre_cam) || !has_inside(map.blocks[id])) return;
    add(centre_cam);
  }

 private:
  /// Half the edge of the box that a surface of the block stays in: cells reach one voxel beyond it.
  STILLMAP_HD float half_edge_m() const { return (0.5f * kBlockEdge + 1.0f) * map.voxel_m; }

  /// How far the box reaches from its centre along `axis` (camera frame, any length), times that length.
  STILLMAP_HD float reach(Vec3 axis) const {
    const Mat3& r = T_cam_map.rotation;
    return half_edge_m() * (fabsf(axis.x * r(0, 0) + axis.y * r(1, 0) + axis.z * r(2, 0)) +
                            fabsf(axis.x * r(0, 1) + axis.y * r(1, 1) + axis.z * r(2, 1)) +
                            fabsf(axis.x * r(0, 2) + axis.y * r(1, 2) + axis.z * r(2, 2)));
  }

  /// False: the box lies outside one of the planes around the view. False for NaN.
  STILLMAP_HD bool may_be_seen(Vec3 c) const {
    const auto cut = [&](Vec3 outwards) { return dot(outwards, c) <= reach(outwards); };
    const float deep = reach({0, 0, 1});
    const float right = static_cast<float>(k.width) - k.cx, bottom = static_cast<float>(k.height) - k.cy;
    return c.z + deep >= near_m && c.z - deep <= far_m && cut({k.fx, 0, -right}) &&
           cut({-k.fx, 0, -k.cx - 1.0f}) && cut({0, k.fy, -bottom}) && cut({0, -k.fy, -k.cy - 1.0f});
  }

  STILLMAP_HD static bool has_inside(const VoxelBlock& block) {
    for (int32_t i = 0; i < kBlockVoxels; i += 64) {
      int32_t inside = 0;
      for (int32_t j = i; j < i + 64; ++j)
        inside |= static_cast<int32_t>(block.surface[j].sdf < 0) &
                  static_cast<int32_t>(block.surface[j].sdf != kSdfUnobserved);
      if (inside) return true;
    }
    return false;
  }

  STILLMAP_HD void add(Vec3 centre_cam) const {
    const float half = half_edge_m();
    const float deep = reach({0, 0, 1});
    const float nearest = centre_cam.z - deep, farthest = centre_cam.z + deep;
    if (nearest < max_of(near_m, 0.01f)) {  // around the camera: its outline has no use
      for (int32_t row = 0; row < ranges.tiles.rows; ++row)
        for (int32_t col = 0; col < ranges.tiles.cols; ++col)
          widen(ranges.tiles.at(row, col), near_m, farthest);
      return;
    }
    float left = 1e9f, right = -1e9f, top = 1e9f, bottom = -1e9f;
    for (int32_t i = 0; i < 8; ++i) {
      const Vec3 corner = {i & 1 ? half : -half, i & 2 ? half : -half, i & 4 ? half : -half};
      const Pixel p = project(k, centre_cam + T_cam_map.rotation * corner);
      left = min_of(left, p.u), right = max_of(right, p.u);
      top = min_of(top, p.v), bottom = max_of(bottom, p.v);
    }
    const int32_t row0 = tile_of(top, ranges.tiles.rows), row1 = tile_of(bottom, ranges.tiles.rows);
    const int32_t col0 = tile_of(left, ranges.tiles.cols), col1 = tile_of(right, ranges.tiles.cols);
    for (int32_t row = row0; row <= row1; ++row)
      for (int32_t col = col0; col <= col1; ++col) widen(ranges.tiles.at(row, col), nearest, farthest);
  }

  /// Kept within the image: a tile too many does no harm.
  STILLMAP_HD int32_t tile_of(float pixel, int32_t tiles) const {
    const float tile = floorf(pixel / static_cast<float>(ranges.tile_px));
    return static_cast<int32_t>(min_of(max_of(tile, 0.0f), static_cast<float>(tiles - 1)));
  }

  STILLMAP_HD static void widen(RayRange& range, float nearest, float farthest) {
    const uint32_t low = bits_of(nearest), high = bits_of(farthest);
    uint32_t was = atomic_load(&range.nearest_bits);
    while (low < was) {
      const uint32_t found = atomic_compare_exchange(&range.nearest_bits, was, low);
      if (found == was) break;
      was = found;
    }
    was = atomic_load(&range.farthest_bits);
    while (high > was) {
      const uint32_t found = atomic_compare_exchange(&range.farthest_bits, was, high);
      if (found == was) break;
      was = found;
    }
  }
};

}  // namespace stillmap
