#pragma once

// How large the parts of a map are, and what a record of a group must say. Host code of both engines.

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "kernels/base/view.hpp"
#include "kernels/map/group_record.hpp"
#include "kernels/params.hpp"

namespace stillmap {

struct MapSizes {
  uint64_t blocks, groups, partly;
  uint32_t slots;  ///< of the table, a power of two
};

inline MapSizes map_sizes(const MapParams& params) {
  // Surfaces fill a third of the groups they are in; the rest is for the rim of what was seen.
  constexpr uint64_t kBlocksPerGroup = 4, kFewestGroups = 1024;
  // The rim of a view runs through the middle of rooms: nearly as many blocks as surfaces have, of 80 bytes
  // each.
  constexpr uint64_t kPartlyPerBlock = 1;
  // Groups that are free throughout, or in the archive, take a slot and nothing else.
  constexpr uint64_t kSlotsPerBlock = 2, kFewestSlots = 16;
  const uint64_t blocks = static_cast<uint64_t>(params.pool_blocks);
  const bool hierarchical = params.free_space == FreeSpace::hierarchical;
  uint64_t slots = 1;
  while (slots < std::max(kSlotsPerBlock * blocks, kFewestSlots)) slots *= 2;
  return {blocks, std::max(blocks / kBlocksPerGroup, std::min(blocks, kFewestGroups)),
          hierarchical ? blocks * kPartlyPerBlock : 0, static_cast<uint32_t>(slots)};
}

/// False: no record, or one that does not hold what its head says.
inline bool read_head(View<const uint8_t> record, GroupRecordHead& head) {
  if (record.size < sizeof head) return false;
  std::memcpy(&head, record.data, sizeof head);
  uint32_t bytes = sizeof head;
  for (int32_t i = 0; i < kGroupBlocks; ++i) {
    const auto kind = static_cast<BlockKind>(head.kind[i]);
    if (kind > BlockKind::partly || (head.uniform_looks > 0 && kind != BlockKind::unknown)) return false;
    const bool looked_at = kind == BlockKind::free || kind == BlockKind::partly;
    constexpr uint8_t kMostSettled = 2;  // kNoSurfaceLeft
    if (looked_at != (head.looks[i] > 0) || head.settled[i] > kMostSettled) return false;
    bytes += payload_bytes(kind);
  }
  return head.bytes == bytes && record.size == bytes && head.uniform_looks <= 255 &&
         head.group == pack(unpack(head.group));
}

}  // namespace stillmap
