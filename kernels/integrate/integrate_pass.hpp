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
  ImageView<const Rgb8> colour;
  Se3 T_cam_map;
  int32_t weight_cap;
  bool free_space;
  uint32_t frame;  ///< counts frames, for the dither

  STILLMAP_HD void operator()(VisibleBlock visible) const {
    if (visible.all_free())
      fuse_free_block(visible.id());
    else
      fuse_mixed_block(visible.id());
  }

 private:
  STILLMAP_HD void fuse_free_block(BlockId id) const {
    if (map.settled_free[id]) return;
    VoxelBlock& block = map.blocks[id];
    bool settled = true;
    for (int32_t i = 0; i < kBlockVoxels; ++i) {
      fuse_free(block.surface[i], block.record[i], weight_cap);
      settled &= block.surface[i].sdf == kSdfMax && block.record[i].weight == weight_cap;
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
    const float units_per_m = static_cast<float>(kSdfMax) / map.truncation_m;
    bool touched_band = false;
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y) {
        const Vec3 row_cam = origin_cam + static_cast<float>(y) * dy + static_cast<float>(z) * dz;
        for (int32_t x = 0; x < kBlockEdge; ++x) {
          const Observation o = observe(geometry, row_cam + static_cast<float>(x) * dx);
          const int32_t i = voxel_index(x, y, z);
          if (o.seen == Seen::nothing) continue;
          if (o.seen == Seen::free) {
            if (free_space || block.record[i].weight > 0)
              fuse_free(block.surface[i], block.record[i], weight_cap);
            continue;
          }
          touched_band = true;
          fuse_distance(block.surface[i], block.record[i], o.sdf_m * units_per_m, weight_cap);
          fuse_colour(block.surface[i], block.record[i], colour.at(o.row, o.col), weight_cap,
                      dither(static_cast<uint32_t>(i) + id * kBlockVoxels, frame));
        }
      }
    if (touched_band) map.settled_free[id] = 0;
  }
};

}  // namespace stillmap
