#pragma once

// The map on the GPU as the rest of the program asks for it: groups as records, lists of groups, points. One
// block each unless said otherwise: none of it is part of a frame.

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/backend/cuda/map_update.hpp"
#include "kernels/frame_rules.hpp"
#include "kernels/map/group_order.hpp"
#include "kernels/map/group_record.hpp"

namespace stillmap {

/// Between host and kernels.
struct MapMail {
  uint32_t count = 0;   ///< bytes or entries that a kernel wrote
  uint32_t failed = 0;  ///< 1: no room
};

namespace map_access_detail {

/// Gives back what a block holds.  @thread one
STILLMAP_GRID void remove(const DeviceMap& map, BlockRef block) {
  if (has_id(block)) {
    map.view.block_keys[block] = kEmptyKey;
    map.view.pool.give_back(block);
  } else if (is_partly(block)) {
    map.view.partly[payload(block)].key = kEmptyKey;
    map.view.partly_pool.give_back(payload(block));
  }
}
STILLMAP_GRID BlockKind kind_of(BlockRef block) {
  return has_id(block)      ? BlockKind::voxels
         : is_free(block)   ? BlockKind::free
         : is_partly(block) ? BlockKind::partly
                            : BlockKind::unknown;
}
/// @param words memory of a voxel block or of the layers of a partly seen one; null when there is none
STILLMAP_GRID uint32_t* payload_of(const DeviceMap& map, BlockRef block) {
  if (has_id(block)) return reinterpret_cast<uint32_t*>(&map.view.blocks[block]);
  if (is_partly(block)) return reinterpret_cast<uint32_t*>(map.view.partly[payload(block)].layer);
  return nullptr;
}

}  // namespace map_access_detail

/// A pool without anything taken.  Many blocks.
struct FillPoolKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  View<BlockId> free_ids;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, free_ids.size, [&](uint32_t i) { free_ids[i] = i; });
  }
};

/// The block that all free blocks share, and counters as they are for an empty map.
struct ClearMapKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  DeviceMap map;
  VoxelBlock* free_block;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all_in_block(block, static_cast<uint32_t>(kBlockVoxels), [&](uint32_t i) {
      VoxelRecord record;
      record.weight = 255;
      free_block->surface[i] = {kSdfMax, 0};
      free_block->record[i] = record;
    });
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      MapCounters& c = *map.counters;
      c.used[0] = c.used[1] = c.used[2] = c.table_entries = c.archived_groups = 0;
    });
  }
};

/// A group into a record; 0 bytes: there is no such group, or it does not fit.
struct WriteGroupKernel {
  static constexpr uint32_t kLanes = 256;
  struct Shared {
    GroupRecordHead head;
    BlockRef block[kGroupBlocks];
    uint32_t at[kGroupBlocks];  ///< where the payload of a block begins, bytes
    bool any;
  };
  DeviceMap map;
  BlockKey key;
  View<uint8_t> record;  ///< at a multiple of 4
  MapMail* mail;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    Shared& s = block.shared();
    block.each([&](uint32_t lane) {
      if (lane == 0) s.any = describe(s);
    });
    if (!s.any) return;
    for (uint32_t i = 0; i < kGroupBlocks; ++i) {
      const uint32_t* from = map_access_detail::payload_of(map, s.block[i]);
      auto* to = reinterpret_cast<uint32_t*>(record.data + s.at[i]);
      const uint32_t words = payload_bytes(static_cast<BlockKind>(s.head.kind[i])) / 4;
      for_all_in_block(block, words, [&](uint32_t w) { to[w] = from[w]; });
    }
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      *reinterpret_cast<GroupRecordHead*>(record.data) = s.head;
      mail->count = s.head.bytes;
    });
  }

 private:
  STILLMAP_GRID bool describe(Shared& s) const {
    mail->count = 0;
    const BlockRef group = map.view.table.find(key);
    if (group == kNoBlock || is_archived(group)) return false;
    GroupRecordHead& head = s.head;
    head.group = key;
    head.bytes = sizeof head;
    head.uniform_looks = is_free(group) ? payload(group) : 0u;
    for (int32_t i = 0; i < kGroupBlocks; ++i) {
      const BlockRef ref = has_id(group) ? map.view.groups[group].block[i] : kNoBlock;
      const BlockKind kind = map_access_detail::kind_of(ref);
      s.block[i] = ref;
      s.at[i] = head.bytes;
      head.kind[i] = static_cast<uint8_t>(kind);
      head.settled[i] = kind == BlockKind::voxels ? map.view.settled_free[ref] : uint8_t{0};
      const uint32_t looks = kind == BlockKind::free     ? payload(ref)
                             : kind == BlockKind::partly ? map.view.partly[payload(ref)].looks
                                                         : 0u;
      head.looks[i] = static_cast<uint8_t>(looks);
      head.bytes += payload_bytes(kind);
    }
    return head.bytes <= record.size;
  }
};

/// A record that read_head has found good into the map, in place of what is known there.
struct ReadGroupKernel {
  static constexpr uint32_t kLanes = 256;
  struct Shared {
    uint32_t* to[kGroupBlocks];
    uint32_t at[kGroupBlocks];
    bool fits;
  };
  DeviceMap map;
  View<const uint8_t> record;
  MapMail* mail;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    Shared& s = block.shared();
    const auto& head = *reinterpret_cast<const GroupRecordHead*>(record.data);
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      s.fits = has_room_for(head) && make_room(head, s);
      mail->failed = static_cast<uint32_t>(!s.fits);
    });
    if (!s.fits || head.uniform_looks > 0) return;
    for (uint32_t i = 0; i < kGroupBlocks; ++i) {
      const auto* from = reinterpret_cast<const uint32_t*>(record.data + s.at[i]);
      const uint32_t words = payload_bytes(static_cast<BlockKind>(head.kind[i])) / 4;
      for_all_in_block(block, words, [&](uint32_t w) { s.to[i][w] = from[w]; });
    }
  }

 private:
  STILLMAP_GRID bool has_room_for(const GroupRecordHead& head) const {
    uint32_t voxels = 0, partly = 0;
    for (const uint8_t kind : head.kind) {
      voxels += static_cast<uint32_t>(static_cast<BlockKind>(kind) == BlockKind::voxels);
      partly += static_cast<uint32_t>(static_cast<BlockKind>(kind) == BlockKind::partly);
    }
    const uint32_t* used = map.counters->used;
    return voxels <= map.view.pool.free_ids.size - used[0] &&
           1 <= map.view.group_pool.free_ids.size - used[1] &&
           partly <= map.view.partly_pool.free_ids.size - used[2];
  }
  STILLMAP_GRID bool make_room(const GroupRecordHead& head, Shared& s) const {
    BlockRef* const slot = map.slot_for(head.group);
    MapCounters& c = *map.counters;
    c.table_full += static_cast<uint64_t>(!slot);
    if (!slot) return false;
    const BlockRef was = *slot;
    c.table_entries += static_cast<uint32_t>(was == kNoBlock);
    c.archived_groups -= static_cast<uint32_t>(is_archived(was));
    if (has_id(was)) {
      for (const BlockRef ref : map.view.groups[was].block) map_access_detail::remove(map, ref);
      map.view.group_pool.give_back(was);
    }
    if (head.uniform_looks > 0) {
      *slot = free_ref(head.uniform_looks);
    } else {
      const BlockId id = map.view.group_pool.take();
      uint32_t at = sizeof head;
      for (int32_t i = 0; i < kGroupBlocks; ++i) {
        const BlockRef ref = take(head, i);
        map.view.groups[id].block[i] = ref;
        s.to[i] = map_access_detail::payload_of(map, ref);
        s.at[i] = at;
        at += payload_bytes(static_cast<BlockKind>(head.kind[i]));
      }
      *slot = id;
    }
    c.note_peak();
    return true;
  }
  STILLMAP_GRID BlockRef take(const GroupRecordHead& head, int32_t i) const {
    const auto kind = static_cast<BlockKind>(head.kind[i]);
    const BlockKey key = pack(block_in_group(unpack(head.group), i));
    if (kind == BlockKind::voxels) {
      const BlockId id = map.view.pool.take();
      map.view.block_keys[id] = key;
      map.view.settled_free[id] = head.settled[i];
      return id;
    }
    if (kind == BlockKind::partly) {
      const uint32_t id = map.view.partly_pool.take();
      map.view.partly[id].key = key;
      map.view.partly[id].looks = head.looks[i];
      map.view.partly[id].grew = true;
      return kPartlyRef | id;
    }
    return kind == BlockKind::free ? free_ref(head.looks[i]) : kNoBlock;
  }
};

/// See Engine::put_away and forget_group.
struct PutAwayKernel {
  static constexpr uint32_t kLanes = kWarp;
  using Shared = NoShared;
  DeviceMap map;
  BlockKey key;
  uint32_t entry;
  bool forget;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      BlockRef* const slot = map.view.table.slot_of(key);
      if (slot && forget && is_archived(*slot)) {
        *slot = kNoBlock;
        --map.counters->table_entries;
        --map.counters->archived_groups;
      } else if (slot && !forget && has_id(*slot)) {
        for (const BlockRef ref : map.view.groups[*slot].block) map_access_detail::remove(map, ref);
        map.view.group_pool.give_back(*slot);
        *slot = archived_ref(entry);
        ++map.counters->archived_groups;
      }
    });
  }
};

/// All groups of the table, in no order. Many blocks.
struct ListGroupsKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  DeviceMap map;
  const VisibleGroupPass* view;  ///< of the last frame; null: nothing is in view
  float margin_m;
  View<GroupEntry> entries;  ///< as many as the table has slots
  MapMail* mail;             ///< count 0 before

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, map.view.table.keys.size, [&](uint32_t slot) {
      const BlockKey key = map.view.table.keys[slot];
      const BlockRef ref = map.view.table.blocks[slot];
      if (key == kEmptyKey || ref == kNoBlock) return;
      entries[atomic_add(&mail->count, 1u)] = {key, ref, static_cast<uint32_t>(in_view(key))};
    });
  }

 private:
  STILLMAP_GRID bool in_view(BlockKey key) const {
    if (!view) return false;
    VisibleGroupPass pass = *view;
    pass.margin_m = margin_m;
    return pass.comes_into_view(unpack(key));
  }
};

/// A group of the archive that was looked at.
struct WantedEntry {
  BlockKey key;
  uint32_t entry;
  uint32_t index;  ///< of the group in the box around the view
  uint32_t in_view;
};
/// In no order. Many blocks.
struct ListWantedKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  UpdateMemory memory;
  View<WantedEntry> entries;
  MapMail* mail;  ///< count 0 before

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, memory.state->groups, [&](uint32_t g) {
      const BlockRef archived = memory.groups[g].view.archived;
      if (archived == kNoBlock) return;
      VisibleGroupPass pass = memory.state->visible;
      const Int3 at = pass.group_at(g);
      pass.margin_m = 0;
      const uint32_t n = atomic_add(&mail->count, 1u);
      if (n < entries.size)
        entries[n] = {pack(at), payload(archived), g, static_cast<uint32_t>(pass.comes_into_view(at))};
    });
  }
};

/// Gives up groups from the end of a list until there is room in the pools. What is left of the list is told
/// by mail->count.
struct GiveUpKernel {
  static constexpr uint32_t kLanes = kGroupBlocks;
  struct Counts {
    uint32_t voxels, partly;
    STILLMAP_HD friend Counts operator+(Counts a, Counts b) {
      return {a.voxels + b.voxels, a.partly + b.partly};
    }
    STILLMAP_HD friend Counts operator-(Counts a, Counts b) {
      return {a.voxels - b.voxels, a.partly - b.partly};
    }
  };
  struct Shared {
    Counts counts[kLanes / kWarp];
  };
  DeviceMap map;
  View<const GroupEntry> order;  ///< as KeptLonger sorts it
  MapMail* mail;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    uint32_t left = order.size;
    while (left > 0 && !enough_room(left)) give_up(block, order[--left]);
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      mail->count = left;
      map.counters->table_entries = 0;  // RebuildTableKernel counts them again
    });
  }

 private:
  STILLMAP_GRID bool enough_room(uint32_t entries) const {
    const uint32_t* used = map.counters->used;
    return has_room(used[0], map.view.pool.free_ids.size) &&
           has_room(used[1], map.view.group_pool.free_ids.size) &&
           has_room(used[2], map.view.partly_pool.free_ids.size) &&
           has_room(entries, most_entries(map.view.table.keys.size));
  }
  template <class Block>
  STILLMAP_GRID void give_up(Block& block, const GroupEntry& group) const {
    MapCounters& c = *map.counters;
    Counts all = {0, 0};
    if (has_id(group.ref)) {
      const uint32_t used_voxels = c.used[0], used_partly = c.used[2];
      PerLane<Block, Counts> rank;
      block.privately([&](uint32_t lane) {
        const BlockRef ref = map.view.groups[group.ref].block[lane];
        rank[lane] = {static_cast<uint32_t>(has_id(ref)), static_cast<uint32_t>(is_partly(ref))};
      });
      all = scan_block(block, rank, block.shared().counts);
      block.each([&](uint32_t lane) {
        const BlockRef ref = map.view.groups[group.ref].block[lane];
        if (has_id(ref)) {
          map.view.block_keys[ref] = kEmptyKey;
          map.view.pool.free_ids[used_voxels - 1 - rank[lane].voxels] = ref;
        } else if (is_partly(ref)) {
          map.view.partly[payload(ref)].key = kEmptyKey;
          map.view.partly_pool.free_ids[used_partly - 1 - rank[lane].partly] = payload(ref);
        }
      });
    }
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      c.used[0] -= all.voxels;
      c.used[2] -= all.partly;
      if (has_id(group.ref)) map.view.group_pool.give_back(group.ref);
      c.archived_groups -= static_cast<uint32_t>(is_archived(group.ref));
      c.dropped_blocks += all.voxels + static_cast<uint32_t>(is_archived(group.ref));
    });
  }
};

/// Enters what is left into an empty table. Many blocks.
struct RebuildTableKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  DeviceMap map;
  View<const GroupEntry> order;
  const MapMail* mail;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, mail->count, [&](uint32_t i) {
      BlockRef* const slot = map.slot_for(order[i].key);
      if (slot) {
        *slot = order[i].ref;
        atomic_add(&map.counters->table_entries, 1u);
      } else {
        atomic_add(&map.counters->table_full, uint64_t{1});
      }
    });
  }
};

/// See Engine::look_up. Many blocks.
struct LookUpKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  VolumeView map;
  View<const Vec3> points_map_m;
  View<PointState> states;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, points_map_m.size, [&](uint32_t i) {
      BlockCache cache;
      states[i] = point_state(map, points_map_m[i], cache);
    });
  }
};

}  // namespace stillmap
