#pragma once

#include <cstdint>

#include "kernels/integrate/fuse_voxel.hpp"

namespace stillmap {

/// One entry of the list of visible blocks: id, and in the top bit whether all of the block is seen free.
struct VisibleBlock {
  uint32_t bits;

  static constexpr uint32_t kFree = 1u << 31;
  STILLMAP_HD BlockId id() const { return bits & ~kFree; }
  STILLMAP_HD bool all_free() const { return (bits & kFree) != 0; }
};

/// Fuses one frame into one visible block: distance, colour, free space and carving (paper III-A, III-D).
struct IntegratePass {
  VolumeView map;
  FrameGeometry geometry;
  const LumaChroma* colour;  ///< same pixels as geometry.static_depth_m
  Se3 T_cam_map;
  FuseWeights weights;
  bool free_space;  ///< false: a voxel that was never in the band stays unobserved
  uint32_t frame;   ///< counts frames, for the dither

  STILLMAP_HD void operator()(VisibleBlock visible) const {
    if (!visible.all_free())
      fuse_mixed_block(visible.id());
    else if (!map.settled_free[visible.id()])
      fuse_free_block(visible.id());
  }

 private:
  STILLMAP_HD void fuse_free_block(BlockId id) const {
    VoxelBlock& block = map.blocks[id];
    bool settled = true;
    for (int32_t i = 0; i < kBlockVoxels; ++i) {
      const Seen seen = free_space || block.record[i].weight > 0 ? Seen::free : Seen::nothing;
      fuse_voxel(block.surface[i], block.record[i], seen, 0.0f, {}, weights, 0.0f);
      settled &= (block.surface[i].sdf == kSdfMax) & (block.record[i].weight >= weights.weight_cap);
    }
    map.settled_free[id] = settled;
  }

  STILLMAP_HD void fuse_mixed_block(BlockId id) const {
    VoxelBlock& block = map.blocks[id];
    const Int3 first = first_voxel(unpack(map.block_keys[id]));
    const Vec3 origin_cam = T_cam_map * voxel_position(first, map.voxel_m);
    const Mat3& r = T_cam_map.rotation;
    const Vec3 dx = map.voxel_m * Vec3{r(0, 0), r(1, 0), r(2, 0)},
               dy = map.voxel_m * Vec3{r(0, 1), r(1, 1), r(2, 1)},
               dz = map.voxel_m * Vec3{r(0, 2), r(1, 2), r(2, 2)};
    int32_t touched_band = 0;
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y) {
        const Vec3 row_cam = origin_cam + static_cast<float>(y) * dy + static_cast<float>(z) * dz;
        touched_band |= fuse_row(block, voxel_index(0, y, z), row_cam, dx, id);
      }
    if (touched_band) map.settled_free[id] = 0;
  }

  /// Eight voxels along x: first what the frame says of them, then, unless it says nothing, the update.
  STILLMAP_HD int32_t fuse_row(VoxelBlock& block, int32_t first, Vec3 row_cam, Vec3 dx, BlockId id) const {
    Seen seen[kBlockEdge];
    float sdf_m[kBlockEdge];
    int32_t pixel[kBlockEdge];
    int32_t any = 0, band = 0;
    for (int32_t x = 0; x < kBlockEdge; ++x) {
      const Observation o = observe(geometry, row_cam + static_cast<float>(x) * dx);
      const bool keep = (o.seen == Seen::band) |
                        ((o.seen == Seen::free) & (free_space | (block.record[first + x].weight > 0)));
      seen[x] = keep ? o.seen : Seen::nothing;
      sdf_m[x] = o.sdf_m;
      pixel[x] = o.pixel;
      any |= static_cast<int32_t>(seen[x]);
      band |= static_cast<int32_t>(o.seen == Seen::band);
    }
    if (any == 0) return 0;
    for (int32_t x = 0; x < kBlockEdge; ++x) {
      const int32_t i = first + x;
      fuse_voxel(block.surface[i], block.record[i], seen[x], sdf_m[x], colour[pixel[x]], weights,
                 dither(static_cast<uint32_t>(i) + id * kBlockVoxels, frame));
    }
    return band;
  }
};

}  // namespace stillmap
