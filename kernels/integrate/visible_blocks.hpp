#pragma once

// Which blocks a frame can change: found from the camera's view, never by a walk over the table.

#include <cstdint>

#include "kernels/integrate/depth_range.hpp"
#include "kernels/integrate/fuse_voxel.hpp"

namespace stillmap {

enum class BlockView : uint8_t {
  nothing,           ///< outside the view, or wholly hidden
  free,              ///< every voxel is seen free
  free_if_measured,  ///< every voxel is seen free but for those on whose ray nothing was measured
  no_surface,        ///< no voxel is in the band; which are seen free only a look at the voxels tells
  mixed              ///< look at the voxels
};

/// Where something surely lies in the view: depths along the optical axis, a rectangle of pixels.
struct ViewBounds {
  float near_m, far_m;
  float u0, u1, v0, v1;
};

/// @param centre_cam metres; @param near_m > 0: nothing nearer is asked for
STILLMAP_HD ViewBounds bounds_of_sphere(const Intrinsics& k, Vec3 centre_cam, float radius_m, float near_m) {
  const float far_m = centre_cam.z + radius_m;
  near_m = centre_cam.z - radius_m > near_m ? centre_cam.z - radius_m : near_m;
  // The widest pixel rectangle that the sphere's box can cover, from its nearest or its farthest depth.
  const float inv_near = 1.0f / near_m, inv_far = 1.0f / far_m;
  const float x0 = centre_cam.x - radius_m, x1 = centre_cam.x + radius_m;
  const float y0 = centre_cam.y - radius_m, y1 = centre_cam.y + radius_m;
  return {centre_cam.z - radius_m,
          far_m,
          k.fx * x0 * (x0 < 0.0f ? inv_near : inv_far) + k.cx,
          k.fx * x1 * (x1 > 0.0f ? inv_near : inv_far) + k.cx,
          k.fy * y0 * (y0 < 0.0f ? inv_near : inv_far) + k.cy,
          k.fy * y1 * (y1 > 0.0f ? inv_near : inv_far) + k.cy};
}

/// Of all voxels of a block, by its eight corners: tighter than the sphere. The block lies before the camera.
/// @param Voxels how voxels are taken: the corners are as many as the voxels of a row
template <class Voxels>
STILLMAP_HD ViewBounds bounds_of_corners(const Intrinsics& k, const VoxelGrid& grid, const Voxels& voxels) {
  using F = typename Voxels::Number;
  ViewBounds b = {1e30f, -1e30f, 1e30f, -1e30f, 1e30f, -1e30f};
  const auto widen = [&](float& low, float& high, F x) {
    low = min_of(low, voxels.least(x));
    high = max_of(high, voxels.most(x));
  };
  constexpr float kEnd = static_cast<float>(kBlockEdge - 1);
  for (int32_t first = 0; first < 8; first += Voxels::kCount) {
    const auto end = [&](int32_t axis) { return F(kEnd) * voxels.corner(first, axis); };
    const Vec3T<F> p = grid.position(end(0), end(1), end(2));
    const F inv_z = F(1.0f) / p.z;
    widen(b.near_m, b.far_m, p.z);
    widen(b.u0, b.u1, F(k.fx) * p.x * inv_z + F(k.cx));
    widen(b.v0, b.v1, F(k.fy) * p.y * inv_z + F(k.cy));
  }
  return b;
}

/// Bounds against the depth ranges under them. All but `mixed` are certain.         test: visible_blocks_test
/// @param across DepthRangePyramid::query
STILLMAP_HD BlockView classify(const FrameGeometry& g, const DepthRangePyramid& ranges, const ViewBounds& b,
                               int32_t across) {
  constexpr float kRoundingM = 1e-5f;
  const float most_m = (g.free_max_m > g.max_m ? g.free_max_m : g.max_m) + g.truncation_m;
  if (b.far_m < g.min_m || b.near_m > most_m) return BlockView::nothing;
  // A pixel of room on each side: pixels are met by their centres.
  const float u0 = b.u0 - 1.0f, u1 = b.u1 + 1.0f, v0 = b.v0 - 1.0f, v1 = b.v1 + 1.0f;
  const float last_col = static_cast<float>(ranges.image_cols - 1),
              last_row = static_cast<float>(ranges.image_rows - 1);
  if (!(u1 >= 0.0f && v1 >= 0.0f && u0 <= last_col && v0 <= last_row)) return BlockView::nothing;
  const bool inside = u0 >= 0.0f && v0 >= 0.0f && u1 <= last_col && v1 <= last_row;
  const DepthRange range = ranges.query(static_cast<int32_t>(v0 > 0.0f ? v0 : 0.0f),
                                        static_cast<int32_t>(v1 < last_row ? v1 : last_row),
                                        static_cast<int32_t>(u0 > 0.0f ? u0 : 0.0f),
                                        static_cast<int32_t>(u1 < last_col ? u1 : last_col), across);
  if (range.max_m <= 0.0f || b.near_m > range.max_m + g.truncation_m + kRoundingM) return BlockView::nothing;
  const float far_m = b.far_m + g.truncation_m + kRoundingM;
  if (far_m >= range.nearest_m) return BlockView::mixed;
  if (!inside || b.near_m < g.min_m || b.far_m > g.free_max_m) return BlockView::no_surface;
  return range.min_m > 0.0f ? BlockView::free : BlockView::free_if_measured;
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

/// A box of groups.
struct GroupBox {
  Int3 first, groups;
};
/// The box of groups around a view, from the camera to `farthest_m` along the optical axis, and `around_m`
/// more on all sides.
STILLMAP_HD GroupBox box_around_view(const Se3& T_map_cam, const Intrinsics& k, float farthest_m,
                                     float around_m, float group_m) {
  Vec3 low = T_map_cam.translation, high = low;
  for (int32_t corner = 0; corner < 4; ++corner) {
    const float u = corner & 1 ? static_cast<float>(k.width) : -1.0f;
    const float v = corner & 2 ? static_cast<float>(k.height) : -1.0f;
    const Vec3 p = T_map_cam * unproject(k, u, v, farthest_m);
    low = {min_of(low.x, p.x), min_of(low.y, p.y), min_of(low.z, p.z)};
    high = {max_of(high.x, p.x), max_of(high.y, p.y), max_of(high.z, p.z)};
  }
  low = low - Vec3{around_m, around_m, around_m};
  high = high + Vec3{around_m, around_m, around_m};
  const float inv = 1.0f / group_m;
  const auto cell = [&](float x) { return static_cast<int32_t>(floorf(x * inv)); };
  const Int3 first = {cell(low.x), cell(low.y), cell(low.z)},
             last = {cell(high.x), cell(high.y), cell(high.z)};
  return {first, {last.x - first.x + 1, last.y - first.y + 1, last.z - first.z + 1}};
}

/// What a frame does to one group of blocks: a bit a block.
struct GroupView {
  uint64_t free = 0;             ///< all of the block is seen free, and that says something new
  uint64_t mixed = 0;            ///< needs voxels
  uint64_t partly = 0;           ///< has no voxels and needs none: some of it is seen free
  BlockRef archived = kNoBlock;  ///< the group is in the archive and comes into view
};

/// Classifies the blocks of one group (4x4x4).
struct VisibleGroupPass {
  VolumeView map;
  FrameGeometry geometry;
  DepthRangePyramid ranges;
  Se3 T_cam_map;
  Int3 first_group;      ///< group coordinates of the first group of the box that encloses the view
  Int3 groups;           ///< extent of that box
  bool free_space;       ///< false: free space is not stored, only what is in the map is carved
  bool dense = true;     ///< free space is stored in voxels (paper III-D)
  uint32_t enough = 64;  ///< looks at a free block without voxels, after which more say nothing new
  float margin_m = 0;    ///< around the view, from which on groups are fetched from the archive
  static constexpr int32_t kFirstLooks = 4;
  uint32_t first_looks = kFirstLooks;  ///< at a block without voxels; from then on such blocks take turns
  int32_t frame = 0;                   ///< counts frames, for the turns

  STILLMAP_HD Int3 group_at(uint32_t index) const {
    const int32_t i = static_cast<int32_t>(index);
    return first_group + Int3{i % groups.x, i / groups.x % groups.y, i / (groups.x * groups.y)};
  }
  STILLMAP_HD Int3 block_at(uint32_t group_index, int32_t bit) const {
    return block_in_group(group_at(group_index), bit);
  }

  /// @param voxels how voxels are taken: PlainVoxels, or a row of them (backend/cpu)
  template <class Voxels>
  STILLMAP_HD GroupView operator()(uint32_t group_index, const Voxels& voxels) const {
    GroupView view;
    const Int3 at = group_at(group_index);
    const GroupLook group = look_at_group(at);
    view.archived = group.archived;
    for (int32_t bit = 0; group.blocks_matter && bit < kGroupBlocks; ++bit)
      look_at_block(at, group, bit, voxels, view);
    return view;
  }

  /// What the frame says of a group as a whole.
  struct GroupLook {
    BlockRef ref;                  ///< of the group
    BlockView whole;               ///< for all of its blocks
    bool blocks_matter;            ///< false: nothing is new about any of them
    BlockRef archived = kNoBlock;  ///< see GroupView
  };
  STILLMAP_HD GroupLook look_at_group(Int3 at) const {
    const BlockRef ref = map.table.find(pack(at));
    // Nothing is told to a group that is away: what it held is not to be made anew beside it.
    if (is_archived(ref)) return {ref, BlockView::nothing, false, comes_into_view(at) ? ref : kNoBlock};
    const BlockView whole = look(block_in_group(at, 0), group_cube());
    const bool nothing_new =
        (whole == BlockView::free || whole == BlockView::free_if_measured) && settled(ref);
    return {ref, whole, whole != BlockView::nothing && !nothing_new, kNoBlock};
  }
  /// Adds one block of a group whose blocks matter to `view`. On the GPU each block has its own view, and
  /// their bits are put together.
  template <class Voxels>
  STILLMAP_HD void look_at_block(Int3 at, const GroupLook& group, int32_t bit, const Voxels& voxels,
                                 GroupView& view) const {
    const CubeGeometry cube = cube_geometry(kBlockEdge, map.voxel_m);
    const Int3 block = block_in_group(at, bit);
    const BlockRef ref = has_id(group.ref) ? map.groups[group.ref].block[bit] : group.ref;
    if (has_id(group.ref) && rests(block, ref)) return;
    BlockView seen = group.whole == BlockView::free ? group.whole : look(block, cube);
    if (seen > BlockView::free) seen = look_closely(block, seen, voxels);
    if (seen != BlockView::nothing) add(1ull << bit, seen, block, ref, voxels, view);
  }

  /// In view, or within `margin_m` of it.
  STILLMAP_HD bool comes_into_view(Int3 group) const {
    CubeGeometry cube = group_cube();
    cube.radius_m += margin_m;
    return look(block_in_group(group, 0), cube) != BlockView::nothing;
  }

 private:
  STILLMAP_HD CubeGeometry group_cube() const { return cube_geometry(kGroupEdge * kBlockEdge, map.voxel_m); }
  STILLMAP_HD bool settled(BlockRef ref) const { return is_free(ref) && payload(ref) >= enough; }
  /// Blocks without voxels that were looked at a few times take turns while nothing is new about them: every
  /// look goes over all their voxels. A surface that comes there waits for three frames at most. Partly seen
  /// ones rest every second frame only: a view that turns passes what is still unseen of them in a few.
  STILLMAP_HD bool rests(Int3 block, BlockRef ref) const {
    const bool partly = is_partly(ref);
    const int32_t turns = partly ? 2 : 4;
    const uint32_t looks = is_free(ref) ? payload(ref) : partly ? map.partly[payload(ref)].looks : 0u;
    if (looks < first_looks || (partly && map.partly[payload(ref)].grew)) return false;
    return ((block.x + block.y + block.z + frame) & (turns - 1)) != 0;
  }

  template <class Voxels>
  STILLMAP_HD void add(uint64_t flag, BlockView seen, Int3 block, BlockRef ref, const Voxels& voxels,
                       GroupView& view) const {
    if (seen == BlockView::free) {
      if ((free_space || has_id(ref)) && !settled(ref)) view.free |= flag;
      return;
    }
    if (has_id(ref)) {
      view.mixed |= flag;
      return;
    }
    if (seen != BlockView::mixed && !dense && is_free(ref)) {
      // What is known to be free and is not contradicted was looked at once more, holes or not.
      if (seen == BlockView::free_if_measured && free_space && !settled(ref)) view.free |= flag;
      return;
    }
    if (seen != BlockView::mixed && !dense && is_partly(ref)) {
      if (free_space) view.partly |= flag;
      return;
    }
    // Voxels are made only where the frame has something to say about one of them.
    const VoxelsSeen what = look_at_voxels(block, voxels);
    if (what.band || (dense && what.any_free && free_space))
      view.mixed |= flag;
    else if (what.any_free && free_space && !settled(ref))
      add_free(flag, what.all_free, is_free(ref), view);
  }
  STILLMAP_HD BlockView look(Int3 block, const CubeGeometry& cube) const {
    const Vec3 p_map = voxel_position(first_voxel(block), map.voxel_m) + cube.centre_offset_m;
    return classify(geometry, ranges,
                    bounds_of_sphere(geometry.k, T_cam_map * p_map, cube.radius_m, geometry.min_m), 2);
  }
  /// @param at_first what `look` told
  template <class Voxels>
  STILLMAP_HD BlockView look_closely(Int3 block, BlockView at_first, const Voxels& voxels) const {
    constexpr int32_t kTilesAcross = 4;
    const ViewBounds bounds = bounds_of_corners(geometry.k, VoxelGrid(T_cam_map, block, map.voxel_m), voxels);
    return bounds.near_m < geometry.min_m ? at_first : classify(geometry, ranges, bounds, kTilesAcross);
  }
  /// A block without voxels of which some is seen free; more than all of it cannot be told of a free one.
  STILLMAP_HD static void add_free(uint64_t flag, bool all_free, bool known_free, GroupView& view) {
    if (all_free)
      view.free |= flag;
    else if (!known_free)
      view.partly |= flag;
  }

  /// What the frame says of the voxels of a block, as far as it matters.
  struct VoxelsSeen {
    bool band = false, any_free = false, all_free = true;
  };
  template <class Voxels>
  STILLMAP_HD VoxelsSeen look_at_voxels(Int3 block, const Voxels& voxels) const {
    using F = typename Voxels::Number;
    const VoxelGrid grid(T_cam_map, block, map.voxel_m);
    VoxelsSeen seen;
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y)
        for (int32_t x = 0; x < kBlockEdge; x += Voxels::kCount) {
          const Observation<F> o = observe(geometry, grid.position<F>(voxels.ramp(x), y, z));
          seen.band = voxels.any(o.band);
          seen.any_free |= voxels.any(o.free);
          seen.all_free &= !voxels.any(!o.free);
          if (seen.band || (dense && seen.any_free && free_space)) return seen;
        }
    return seen;
  }
};

}  // namespace stillmap
