#pragma once

#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/group_order.hpp"
#include "kernels/map/group_record.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Owner of the map's memory on the CPU: table, groups, voxels and their counters. What does not fit is
/// counted and left out.
/// @thread the engine's caller
class MapStorage {
 public:
  /// Takes the memory from `arena` (which may be only measuring).
  /// @param weight_cap looks at a free block, after which more say nothing new
  void carve(Arena& arena, const MapParams& params, int32_t weight_cap);
  void clear();

  const VolumeView& view() const { return view_; }
  MapHealth health() const;

  /// Finds or makes the voxels of a block: unobserved ones, or as free as the block was. Anything but
  /// inserted and existed is counted.
  InsertResult insert(BlockKey key);

  /// One more frame saw all blocks of a group free. Does it without blocks where the group is the same
  /// throughout.
  /// @return false: the group has blocks of different states, or there is no room; nothing was done
  bool see_group_free(Int3 group);
  /// One more frame saw all of a block free.
  /// @return its voxels, which have to be told; kNoBlock when there is nothing more to do
  InsertResult see_free(Int3 block);
  /// Finds or makes the record of which voxels of a block were seen free.
  /// @return kNoBlock when it has voxels, or is free
  InsertResult see_partly(Int3 block);

  /// Takes the voxels from a block in which no surface is left.
  void release_voxels(BlockId id);
  /// A block that was seen free in part, and by now in all its parts, is free.
  void release_partly(uint32_t id);
  /// A group of which all blocks are free for good is one word.
  void merge_group(Int3 group);

  /// See Engine.
  uint32_t list_groups(View<BlockKey> keys) const;
  uint32_t write_group(BlockKey key, View<uint8_t> record) const;
  Status read_group(View<const uint8_t> record);

  /// Groups with blocks for which `keep` is false, the farthest first. @return how many
  template <class Keep>
  uint32_t farthest_groups(Vec3 centre_map, View<BlockKey> keys, const Keep& keep) {
    uint32_t count = 0;
    for (uint32_t i = 0, all = order_groups(); i < all; ++i)
      if (has_id(order_[i].ref) && !keep(order_[i].key)) order_[count++] = order_[i];
    return farthest_of_order(centre_map, count, keys);
  }
  void put_away(BlockKey key, uint32_t entry);
  void forget_group(BlockKey key);

  /// How full the fullest of the pools is, 0..1.
  float fill() const;
  /// True when the pool of voxels, of groups or the table is fuller than map.high_water.
  bool above_high_water() const;
  /// Gives up groups of blocks until a tenth of each pool is free: first those that are not `in_view`, the
  /// farthest from `centre_map` before nearer ones. Counted.
  template <class InView>
  void drop_farthest(Vec3 centre_map, const InView& in_view) {
    const uint32_t groups = order_groups();
    for (uint32_t i = 0; i < groups; ++i) order_[i].in_view = in_view(order_[i].key);
    drop_ordered(centre_map, groups);
  }

 private:
  /// @return null when there is no room
  BlockRef* open(Int3 block);
  BlockGroup* open_group(Int3 group);
  bool count(Insert answer);
  bool has_room_for(const GroupRecordHead& head) const;
  void read_block(const GroupRecordHead& head, int32_t index, const uint8_t*& from, BlockRef& ref);
  uint32_t order_groups();
  void drop_ordered(Vec3 centre_map, uint32_t groups);
  uint32_t farthest_of_order(Vec3 centre_map, uint32_t count, View<BlockKey> keys);
  void remove(BlockRef block);
  void give_up(const GroupEntry& group);
  void rebuild_table(uint32_t groups);
  void note_peak();
  uint64_t bytes_in_use() const;
  uint32_t looks_more(uint32_t looks) const { return looks < enough_ ? looks + 1 : enough_; }

  VolumeView view_;
  View<VoxelBlock> free_block_;  ///< one
  View<uint32_t> used_;          ///< taken from the pools of voxels, groups, partly seen blocks
  View<GroupEntry> order_;       ///< scratch of drop_farthest
  uint32_t table_entries_ = 0;
  uint32_t enough_ = 64;
  float high_water_ = 1;
  MapHealth health_;
};

}  // namespace stillmap
