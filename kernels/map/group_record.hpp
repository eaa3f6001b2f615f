#pragma once

// A group of blocks outside the map: as it is saved, archived, or copied. Plain bytes, little-endian:
//   GroupRecordHead
//   of each block in order: 4096 bytes of VoxelBlock when it has voxels, 64 bytes of layers when seen in part

#include <cstdint>

#include "kernels/map/block_ref.hpp"

namespace stillmap {

enum class BlockKind : uint8_t { unknown, voxels, free, partly };

struct GroupRecordHead {
  BlockKey group;                 ///< packed coordinates of the group
  uint32_t bytes;                 ///< of the whole record
  uint32_t uniform_looks;         ///< above 0: free throughout, seen so often; no block follows
  uint8_t kind[kGroupBlocks];     ///< BlockKind
  uint8_t looks[kGroupBlocks];    ///< of free and partly seen blocks
  uint8_t settled[kGroupBlocks];  ///< VolumeView::settled_free of blocks with voxels
};
static_assert(sizeof(GroupRecordHead) == 208);

constexpr uint32_t kSeenBytes = sizeof(SeenVoxels::layer);
constexpr uint32_t kMaxGroupRecordBytes = sizeof(GroupRecordHead) + kGroupBlocks * sizeof(VoxelBlock);

STILLMAP_HD constexpr uint32_t payload_bytes(BlockKind kind) {
  return kind == BlockKind::voxels   ? static_cast<uint32_t>(sizeof(VoxelBlock))
         : kind == BlockKind::partly ? kSeenBytes
                                     : 0u;
}

}  // namespace stillmap
