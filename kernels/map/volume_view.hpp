#pragma once

#include <cstdint>

#include "kernels/base/lane.hpp"
#include "kernels/map/block_ref.hpp"
#include "kernels/map/hash_view.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

/// The map as kernels see it: a table of groups, their blocks, the voxels of those that have some. Map frame,
/// metres.
struct VolumeView {
  HashView table;  ///< by key of the group (its coordinates, packed): a BlockRef, of a group
  PoolView group_pool;
  View<BlockGroup> groups;
  PoolView pool;
  View<VoxelBlock> blocks;     ///< by BlockId
  View<BlockKey> block_keys;   ///< by BlockId; kEmptyKey: not in use
  View<uint8_t> settled_free;  ///< by BlockId; 1: every voxel is free with full weight, seeing it free again
                               ///< changes nothing
  PoolView partly_pool;
  View<SeenVoxels> partly;
  const VoxelBlock* free_block = nullptr;  ///< what readers see of a block that is free and has no voxels
  float voxel_m = 0.01f;
  float truncation_m = 0.1f;
  int32_t mesh_min_weight = 1;   ///< voxels observed less often do not make a mesh, at least 1
  int32_t mesh_min_surface = 0;  ///< nor do those on whose surface fewer measurements lay

  STILLMAP_HD float sdf_unit_m() const { return truncation_m / static_cast<float>(kSdfMax); }

  /// @return of a block: has_id, is_free, is_partly, or kNoBlock.  @thread any, also while others insert
  STILLMAP_HD BlockRef ref_of(Int3 block) const {
    const BlockRef group = table.find(pack(group_of_block(block)));
    if (has_id(group)) return groups[group].block[index_in_group(block)];
    return is_free(group) ? group : kNoBlock;
  }
  /// @return kNoBlock when the block has no voxels
  STILLMAP_HD BlockId voxels_of(Int3 block) const {
    const BlockRef ref = ref_of(block);
    return has_id(ref) ? ref : kNoBlock;
  }
  STILLMAP_HD BlockAt read(Int3 block) const {
    const BlockRef ref = ref_of(block);
    if (has_id(ref)) return {&blocks[ref], nullptr, 0};
    if (is_free(ref)) return {free_block, nullptr, payload(ref)};
    if (is_partly(ref)) return {free_block, &partly[payload(ref)], partly[payload(ref)].looks};
    return {};
  }
};

/// Last block that was looked up; neighbouring pixels mostly fall into the same one.
struct BlockCache {
  BlockKey key = kEmptyKey;
  BlockAt block;
};

/// @return the block of `key`; false when nothing is known of it.
STILLMAP_HD BlockAt lookup(const VolumeView& map, BlockKey key, BlockCache& cache) {
  if (key != cache.key) cache = {key, map.read(unpack(key))};
  return cache.block;
}

/// Blocks looked up lately, a place a key: on the CPU the eight voxels around a point, and neighbouring rays,
/// go back and forth between a few blocks.
template <int kBits>
struct RecentBlocks {
  BlockCache place[1 << kBits];
};
template <int kBits>
STILLMAP_HD BlockAt lookup(const VolumeView& map, BlockKey key, RecentBlocks<kBits>& recent) {
  return lookup(map, key, recent.place[key * 0x9e3779b97f4a7c15ull >> (64 - kBits)]);
}

/// Of a voxel and its neighbours towards +x, +y, +z: they are in more than one block.
STILLMAP_HD bool lies_across(Int3 base) {
  return ((base.x & 7) == 7) | ((base.y & 7) == 7) | ((base.z & 7) == 7);
}

/// fetch_corners where lies_across.
template <class Cache>
STILLMAP_HD bool fetch_corners_across(const VolumeView& map, Int3 base, Cache& cache, VoxelSurface voxel[8]) {
  const Int3 block = block_of_voxel(base), local = {base.x & 7, base.y & 7, base.z & 7};
  const int32_t crossed = (local.x == 7 ? 1 : 0) | (local.y == 7 ? 2 : 0) | (local.z == 7 ? 4 : 0);
  const int32_t x[2] = {local.x, (local.x + 1) & 7}, y[2] = {local.y, (local.y + 1) & 7},
                z[2] = {local.z, (local.z + 1) & 7};
  // Blocks by the first corner in them: every part of `crossed`, 0 and all of it included. Of each, its
  // corners: that one and those that differ from it by a part of the rest.
  const int32_t rest = 7 & ~crossed;
  for (int32_t part = 0;; part = (part - crossed) & crossed) {
    const BlockAt found =
        lookup(map, pack({block.x + (part & 1), block.y + (part >> 1 & 1), block.z + (part >> 2)}), cache);
    if (!found) return false;
    for (int32_t more = 0;; more = (more - rest) & rest) {
      const int32_t i = part | more;
      voxel[i] = found.surface(voxel_index(x[i & 1], y[i >> 1 & 1], z[i >> 2]));
      if (more == rest) break;
    }
    if (part == crossed) return true;
  }
}

/// Reads a voxel and its seven neighbours towards +x, +y, +z: 000 100 010 110 001 101 011 111. Those that
/// were never observed are kSdfUnobserved.                                       test: volume_test
/// @return false when nothing is known of a block of theirs; `voxel` is then of no meaning
/// @param cache BlockCache or RecentBlocks
template <class Cache>
STILLMAP_HD bool fetch_corners(const VolumeView& map, Int3 base, Cache& cache, VoxelSurface voxel[8]) {
  const Int3 local = {base.x & 7, base.y & 7, base.z & 7};
  if (lies_across(base)) return fetch_corners_across(map, base, cache, voxel);
  const BlockAt block = lookup(map, pack(block_of_voxel(base)), cache);
  if (!block) return false;
  constexpr int32_t y = kBlockEdge, z = kBlockEdge * kBlockEdge;
  const int32_t at = voxel_index(local.x, local.y, local.z);
  if (block.seen)
    for (const int32_t step : {0, 1, y, y + 1, z, z + 1, z + y, z + y + 1})
      if (!block.seen->has(at + step)) return false;
  const VoxelSurface* v = block.voxels->surface + at;
  voxel[0] = v[0], voxel[1] = v[1], voxel[2] = v[y], voxel[3] = v[y + 1];
  voxel[4] = v[z], voxel[5] = v[z + 1], voxel[6] = v[z + y], voxel[7] = v[z + y + 1];
  return true;
}
STILLMAP_HD bool all_observed(const VoxelSurface voxel[8]) {
  bool observed = true;
  for (int32_t i = 0; i < 8; ++i) observed &= voxel[i].sdf != kSdfUnobserved;
  return observed;
}
/// @return false also when one of them was never observed
template <class Cache>
STILLMAP_HD bool read_corners(const VolumeView& map, Int3 base, Cache& cache, VoxelSurface voxel[8]) {
  return fetch_corners(map, base, cache, voxel) && all_observed(voxel);
}

/// Trilinear mean of eight corner values.                                 test: volume_test
/// @param f where the point lies between them, 0..1 along each axis
template <class F>
STILLMAP_HD F trilinear(const F c[8], Vec3T<F> f) {
  const F x00 = c[0] + f.x * (c[1] - c[0]), x10 = c[2] + f.x * (c[3] - c[2]);
  const F x01 = c[4] + f.x * (c[5] - c[4]), x11 = c[6] + f.x * (c[7] - c[6]);
  const F y0 = x00 + f.y * (x10 - x00), y1 = x01 + f.y * (x11 - x01);
  return y0 + f.z * (y1 - y0);
}

/// The same with its gradient by `f` (analytic).                          test: volume_test
template <class F>
STILLMAP_HD F trilinear(const F c[8], Vec3T<F> f, Vec3T<F>& gradient) {
  const F dx00 = c[1] - c[0], dx10 = c[3] - c[2], dx01 = c[5] - c[4], dx11 = c[7] - c[6];
  const F dx0 = dx00 + f.y * (dx10 - dx00), dx1 = dx01 + f.y * (dx11 - dx01);
  const F x00 = c[0] + f.x * dx00, x10 = c[2] + f.x * dx10, x01 = c[4] + f.x * dx01, x11 = c[6] + f.x * dx11;
  const F dy0 = x10 - x00, dy1 = x11 - x01;
  const F y0 = x00 + f.y * dy0, y1 = x01 + f.y * dy1;
  gradient = {dx0 + f.z * (dx1 - dx0), dy0 + f.z * (dy1 - dy0), y1 - y0};
  return y0 + f.z * (y1 - y0);
}

/// The voxel at or below a point, and where the point lies from there, 0..1 along each axis.
/// @param grid position in voxels (p_map / voxel_m)
template <class F>
struct GridCell {
  IntOf<F> x, y, z;
  Vec3T<F> fraction;
};
template <class F>
STILLMAP_HD GridCell<F> cell_of(Vec3T<F> grid) {
  GridCell<F> c{floor_int(grid.x), floor_int(grid.y), floor_int(grid.z), {}};
  c.fraction = {grid.x - to_float(c.x), grid.y - to_float(c.y), grid.z - to_float(c.z)};
  return c;
}

/// V_SDF at a point, metres (paper section III-B).                        test: volume_test
/// @return false when a neighbouring voxel is unobserved
template <class Cache>
STILLMAP_HD bool sample_sdf(const VolumeView& map, const GridCell<float>& cell, Cache& cache, float& sdf_m) {
  VoxelSurface voxel[8];
  if (!read_corners(map, {cell.x, cell.y, cell.z}, cache, voxel)) return false;
  float sdf[8];
  for (int32_t i = 0; i < 8; ++i) sdf[i] = static_cast<float>(voxel[i].sdf);
  sdf_m = trilinear(sdf, cell.fraction) * map.sdf_unit_m();
  return true;
}
/// @param p_map metres
template <class Cache>
STILLMAP_HD bool sample_sdf(const VolumeView& map, Vec3 p_map, Cache& cache, float& sdf_m) {
  return sample_sdf(map, cell_of((1.0f / map.voxel_m) * p_map), cache, sdf_m);
}

}  // namespace stillmap
