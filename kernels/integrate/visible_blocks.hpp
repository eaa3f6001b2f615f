#pragma once

// Which blocks a frame can change: found from the camera's view, never by a walk over the table.

#include <cstdint>

#include "kernels/integrate/depth_range.hpp"
#include "kernels/integrate/fuse_voxel.hpp"

namespace stillmap {

enum class BlockView : uint8_t {
  nothing,  ///< outside the view, or wholly hidden
  free,     ///< every voxel is seen free
  mixed     ///< look at the voxels
};

/// A cube of voxels as a sphere in the camera frame against the depth ranges under it. Conservative:
/// `nothing` and `free` are certain.                                                     test:
/// visible_blocks_test
/// @param centre_cam metres; @param radius_m of the sphere around all voxel positions
STILLMAP_HD BlockView classify(const FrameGeometry& g, const DepthRangePyramid& ranges, Vec3 centre_cam,
                               float radius_m) {
  const float z = centre_cam.z;
  const float far_m = (g.free_max_m > g.max_m ? g.free_max_m : g.max_m) + g.truncation_m;
  if (z + radius_m < g.min_m || z - radius_m > far_m) return BlockView::nothing;
  const float near_m = z - radius_m > g.min_m ? z - radius_m : g.min_m;
  // The widest pixel rectangle that the sphere's box can cover, from its nearest or its farthest depth.
  const float inv_near = 1.0f / near_m, inv_far = 1.0f / (z + radius_m);
  const float x0 = centre_cam.x - radius_m, x1 = centre_cam.x + radius_m;
  const float y0 = centre_cam.y - radius_m, y1 = centre_cam.y + radius_m;
  const float u0 = g.k.fx * x0 * (x0 < 0.0f ? inv_near : inv_far) + g.k.cx - 1.0f;
  const float u1 = g.k.fx * x1 * (x1 > 0.0f ? inv_near : inv_far) + g.k.cx + 1.0f;
  const float v0 = g.k.fy * y0 * (y0 < 0.0f ? inv_near : inv_far) + g.k.cy - 1.0f;
  const float v1 = g.k.fy * y1 * (y1 > 0.0f ? inv_near : inv_far) + g.k.cy + 1.0f;
  const float last_col = static_cast<float>(ranges.image_cols - 1),
              last_row = static_cast<float>(ranges.image_rows - 1);
  if (!(u1 >= 0.0f && v1 >= 0.0f && u0 <= last_col && v0 <= last_row)) return BlockView::nothing;
  const bool inside = u0 >= 0.0f && v0 >= 0.0f && u1 <= last_col && v1 <= last_row;
  const DepthRange range = ranges.query(
      static_cast<int32_t>(v0 > 0.0f ? v0 : 0.0f), static_cast<int32_t>(v1 < last_row ? v1 : last_row),
      static_cast<int32_t>(u0 > 0.0f ? u0 : 0.0f), static_cast<int32_t>(u1 < last_col ? u1 : last_col));
  if (range.max_m <= 0.0f || z - radius_m > range.max_m + g.truncation_m) return BlockView::nothing;
  const bool free = inside && z - radius_m >= g.min_m && z + radius_m <= g.free_max_m && range.min_m > 0.0f &&
                    z + radius_m < range.min_m - g.truncation_m;
  return free ? BlockView::free : BlockView::mixed;
}

/// A block, or a cube of blocks, in the camera frame.
struct CubeGeometry {
  Vec3 centre_offset_m;  ///< from its first voxel, map axes
  float radius_m;
};
/// @param voxels along an edge
STILLMAP_HD CubeGeometry cube_geometry(int32_t voxels, float voxel_m) {
  const float half_m = 0.5f * static_cast<float>(voxels - 1) * voxel_m;
  return {{half_m, half_m, half_m}, 1.7320509f * half_m};
}

constexpr int32_t kGroupEdge = 4;  ///< blocks along an edge of a group: 64 blocks, one bit each
constexpr int32_t kGroupBlocks = kGroupEdge * kGroupEdge * kGroupEdge;

/// What a frame does to one group of blocks: a bit a block.
struct GroupView {
  uint64_t free = 0;
  uint64_t mixed = 0;
};

/// Classifies the blocks of one group (4x4x4).
struct VisibleGroupPass {
  VolumeView map;
  FrameGeometry geometry;
  DepthRangePyramid ranges;
  Se3 T_cam_map;
  Int3 first_group;  ///< group coordinates of the first group of the box that encloses the view
  Int3 groups;       ///< extent of that box
  bool free_space;   ///< false: free space is not stored, only what is in the map is carved

  STILLMAP_HD Int3 group_at(uint32_t index) const {
    const int32_t i = static_cast<int32_t>(index);
    return first_group + Int3{i % groups.x, i / groups.x % groups.y, i / (groups.x * groups.y)};
  }
  STILLMAP_HD Int3 block_at(uint32_t group_index, int32_t bit) const {
    const Int3 g = group_at(group_index);
    return {g.x * kGroupEdge + (bit & 3), g.y * kGroupEdge + (bit >> 2 & 3), g.z * kGroupEdge + (bit >> 4)};
  }

  /// @param voxels how voxels are taken: PlainVoxels, or a row of them (backend/cpu)
  template <class Voxels>
  STILLMAP_HD GroupView operator()(uint32_t group_index, const Voxels& voxels) const {
    GroupView view;
    const CubeGeometry group = cube_geometry(kGroupEdge * kBlockEdge, map.voxel_m);
    const CubeGeometry block = cube_geometry(kBlockEdge, map.voxel_m);
    if (look(block_at(group_index, 0), group) == BlockView::nothing) return view;
    for (int32_t bit = 0; bit < kGroupBlocks; ++bit) {
      const Int3 b = block_at(group_index, bit);
      const BlockView seen = look(b, block);
      const uint64_t flag = 1ull << bit;
      if (seen == BlockView::free && (free_space || map.table.find(pack(b)) != kNoBlock)) view.free |= flag;
      // A block that is not in the map yet is made only when the frame has something to say about one of its
      // voxels.
      if (seen == BlockView::mixed && (map.table.find(pack(b)) != kNoBlock || concerns(b, voxels)))
        view.mixed |= flag;
    }
    return view;
  }

 private:
  STILLMAP_HD BlockView look(Int3 block, const CubeGeometry& cube) const {
    const Vec3 p_map = voxel_position(first_voxel(block), map.voxel_m) + cube.centre_offset_m;
    return classify(geometry, ranges, T_cam_map * p_map, cube.radius_m);
  }
  template <class Voxels>
  STILLMAP_HD bool concerns(Int3 block, const Voxels& voxels) const {
    using F = typename Voxels::Number;
    const VoxelGrid grid(T_cam_map, block, map.voxel_m);
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y)
        for (int32_t x = 0; x < kBlockEdge; x += Voxels::kCount) {
          const Observation<F> o = observe(geometry, grid.position<F>(voxels.ramp(x), y, z));
          if (voxels.any(free_space ? o.band | o.free : o.band)) return true;
        }
    return false;
  }
};

}  // namespace stillmap
