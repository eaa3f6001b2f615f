#pragma once

// What the map knows of a block, in one word, and of a group of blocks.

#include <cstdint>

#include "kernels/map/block_key.hpp"
#include "kernels/map/pool_view.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

/// The state of a block (or, in the table, of a whole group). The two top bits say which:
///   00  it has voxels (a group: it has blocks of different states); the rest is the id in the pool
///   01  free throughout and no voxels; the rest is how often that was seen
///   10  seen free in part and no voxels; the rest is the id of which voxels (SeenVoxels). A group: it is in
///       the archive; the rest is the number of its entry there
///   11  kNoBlock: nothing is known; HashView::kPending
using BlockRef = uint32_t;
constexpr BlockRef kFreeRef = 1u << 30;
constexpr BlockRef kPartlyRef = 2u << 30;
constexpr uint32_t kRefPayload = kFreeRef - 1;
constexpr uint32_t kMaxPoolBlocks = 1u << 30;

STILLMAP_HD bool has_id(BlockRef ref) {
  return ref < kFreeRef;
}
STILLMAP_HD bool is_free(BlockRef ref) {
  return (ref & ~kRefPayload) == kFreeRef;
}
STILLMAP_HD bool is_partly(BlockRef ref) {
  return (ref & ~kRefPayload) == kPartlyRef;
}
/// Of a group.
STILLMAP_HD bool is_archived(BlockRef ref) {
  return (ref & ~kRefPayload) == kPartlyRef;
}
STILLMAP_HD BlockRef archived_ref(uint32_t entry) {
  return kPartlyRef | entry;
}
STILLMAP_HD uint32_t payload(BlockRef ref) {
  return ref & kRefPayload;
}
STILLMAP_HD BlockRef free_ref(uint32_t looks) {
  return kFreeRef | looks;
}

constexpr int32_t kGroupEdge = 4;  ///< blocks along an edge of a group
constexpr int32_t kGroupBlocks = kGroupEdge * kGroupEdge * kGroupEdge;

/// The level above blocks: 4x4x4 of them, x fastest. A group that is free throughout is a word in the table.
struct BlockGroup {
  BlockRef block[kGroupBlocks];
};

STILLMAP_HD Int3 group_of_block(Int3 block) {
  return {block.x >> 2, block.y >> 2, block.z >> 2};
}
STILLMAP_HD int32_t index_in_group(Int3 block) {
  return (block.x & 3) | (block.y & 3) << 2 | (block.z & 3) << 4;
}
STILLMAP_HD Int3 block_in_group(Int3 group, int32_t index) {
  return {group.x * kGroupEdge + (index & 3), group.y * kGroupEdge + (index >> 2 & 3),
          group.z * kGroupEdge + (index >> 4)};
}

/// Of a block without voxels: which of them were seen free. A bit a voxel, x + 8 y in word z.
struct SeenVoxels {
  uint64_t layer[kBlockEdge];
  BlockKey key;      ///< of the block; kEmptyKey: not in use
  uint32_t looks;    ///< frames that saw some of it
  bool grew = true;  ///< the last look at it added some

  STILLMAP_HD bool has(int32_t voxel) const { return (layer[voxel >> 6] >> (voxel & 63) & 1) != 0; }
  STILLMAP_HD bool all() const {
    uint64_t every = ~0ull;
    for (const uint64_t l : layer) every &= l;
    return every == ~0ull;
  }
};

/// A block as readers see it: free ones share the voxels of a block that is free throughout.
struct BlockAt {
  const VoxelBlock* voxels = nullptr;  ///< null: nothing is known
  const SeenVoxels* seen = nullptr;    ///< not null: the other voxels are unobserved
  uint32_t looks = 0;                  ///< above 0: at a free block without voxels

  STILLMAP_HD explicit operator bool() const { return voxels != nullptr; }
  STILLMAP_HD VoxelSurface surface(int32_t voxel) const {
    return !seen || seen->has(voxel) ? voxels->surface[voxel] : VoxelSurface{};
  }
  STILLMAP_HD VoxelRecord record(int32_t voxel) const {
    if (seen && !seen->has(voxel)) return {};
    VoxelRecord record = voxels->record[voxel];
    if (looks > 0) record.weight = static_cast<uint8_t>(looks < 255 ? looks : 255);
    return record;
  }
};

}  // namespace stillmap
