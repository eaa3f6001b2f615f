#include "kernels/backend/cpu/map_storage.hpp"

#include <algorithm>
#include <cstring>

#include "kernels/integrate/integrate_pass.hpp"
#include "kernels/map/map_sizes.hpp"

namespace stillmap {
namespace {

void fill_voxels(VoxelBlock& block, VoxelSurface surface, VoxelRecord record) {
  std::fill_n(block.surface, kBlockVoxels, surface);
  std::fill_n(block.record, kBlockVoxels, record);
}
VoxelRecord seen_often(uint32_t looks) {
  VoxelRecord record;
  record.weight = static_cast<uint8_t>(std::min(looks, 255u));
  return record;
}

void fill_pool(const PoolView& pool) {
  for (uint32_t i = 0; i < pool.free_ids.size; ++i) pool.free_ids[i] = i;
  *pool.used = 0;
}

}  // namespace

void MapStorage::carve(Arena& arena, const MapParams& params, int32_t weight_cap) {
  const auto [blocks, groups, partly, slots] = map_sizes(params);
  view_.voxel_m = params.voxel_m;
  view_.truncation_m = params.truncation_m;
  view_.mesh_min_weight = params.mesh_min_weight;
  view_.mesh_min_surface = params.mesh_min_surface;
  view_.table.keys = arena.take<BlockKey>("map: table", slots);
  view_.table.blocks = arena.take<BlockRef>("map: table", slots);
  order_ = arena.take<GroupEntry>("map: table", slots);
  view_.groups = arena.take<BlockGroup>("map: groups of blocks", groups);
  view_.group_pool.free_ids = arena.take<BlockId>("map: groups of blocks", groups);
  view_.blocks = arena.take<VoxelBlock>("map: voxel blocks", blocks);
  free_block_ = arena.take<VoxelBlock>("map: voxel blocks", 1);
  view_.block_keys = arena.take<BlockKey>("map: block lists", blocks);
  view_.settled_free = arena.take<uint8_t>("map: block lists", blocks);
  view_.pool.free_ids = arena.take<BlockId>("map: block lists", blocks);
  view_.partly = arena.take<SeenVoxels>("map: partly seen blocks", partly);
  view_.partly_pool.free_ids = arena.take<BlockId>("map: partly seen blocks", partly);
  used_ = arena.take<uint32_t>("map: block lists", 3);
  view_.pool.used = used_.data;
  view_.group_pool.used = used_.data + 1;
  view_.partly_pool.used = used_.data + 2;
  view_.free_block = free_block_.data;
  enough_ = static_cast<uint32_t>(weight_cap);
  high_water_ = params.high_water;
  health_.capacity = static_cast<uint32_t>(blocks);
}

void MapStorage::clear() {
  std::fill(view_.table.keys.begin(), view_.table.keys.end(), kEmptyKey);
  std::fill(view_.table.blocks.begin(), view_.table.blocks.end(), kNoBlock);
  std::fill(view_.block_keys.begin(), view_.block_keys.end(), kEmptyKey);
  for (SeenVoxels& seen : view_.partly) seen.key = kEmptyKey;
  for (const PoolView* pool : {&view_.pool, &view_.group_pool, &view_.partly_pool}) fill_pool(*pool);
  fill_voxels(free_block_[0], {kSdfMax, 0}, seen_often(255));
  table_entries_ = 0;
  health_.archived_groups = 0;
}

uint64_t MapStorage::bytes_in_use() const {
  return uint64_t{used_[0]} * (sizeof(VoxelBlock) + sizeof(BlockKey) + sizeof(uint8_t)) +
         uint64_t{used_[1]} * sizeof(BlockGroup) + uint64_t{used_[2]} * sizeof(SeenVoxels) +
         uint64_t{table_entries_} * (sizeof(BlockKey) + sizeof(BlockRef));
}

void MapStorage::note_peak() {
  health_.peak_blocks = std::max(health_.peak_blocks, used_[0]);
  health_.bytes = std::max(health_.bytes, bytes_in_use());
}

MapHealth MapStorage::health() const {
  MapHealth h = health_;
  h.blocks = used_[0];
  h.fill = fill();
  return h;
}

bool MapStorage::count(Insert answer) {
  health_.contended += answer == Insert::contended;
  health_.table_full += answer == Insert::table_full;
  health_.pool_empty += answer == Insert::pool_empty;
  return answer == Insert::inserted || answer == Insert::existed;
}

/// A group of its own blocks: made when there is none, taken apart when it was the same throughout.
BlockGroup* MapStorage::open_group(Int3 group) {
  const BlockKey key = pack(group);
  BlockRef* const known = view_.table.slot_of(key);
  const BlockRef was = known ? *known : kNoBlock;
  if (has_id(was)) return &view_.groups[was];
  const BlockRef blocks_were = is_free(was) ? was : kNoBlock;  // those of an archived one come later
  if (known) *known = kNoBlock;
  const InsertResult made = view_.table.insert(key, view_.group_pool);
  if (!count(made.answer)) {
    if (known) *known = was;
    return nullptr;
  }
  table_entries_ += was == kNoBlock;
  BlockGroup& blocks = view_.groups[made.block];
  std::fill_n(blocks.block, kGroupBlocks, blocks_were);
  health_.archived_groups -= is_archived(was);
  note_peak();
  return &blocks;
}

BlockRef* MapStorage::open(Int3 block) {
  BlockGroup* const group = open_group(group_of_block(block));
  return group ? &group->block[index_in_group(block)] : nullptr;
}

InsertResult MapStorage::insert(BlockKey key) {
  const Int3 at = unpack(key);
  BlockRef* const ref = open(at);
  if (!ref) return {Insert::pool_empty, kNoBlock};
  if (has_id(*ref)) return {Insert::existed, *ref};
  const BlockId id = view_.pool.take();
  if (id == kNoBlock) {
    count(Insert::pool_empty);
    return {Insert::pool_empty, kNoBlock};
  }
  VoxelBlock& block = view_.blocks[id];
  if (is_free(*ref))
    fill_voxels(block, {kSdfMax, 0}, seen_often(payload(*ref)));
  else
    fill_voxels(block, {}, {});
  if (is_partly(*ref)) {
    const SeenVoxels& seen = view_.partly[payload(*ref)];
    for (int32_t i = 0; i < kBlockVoxels; ++i) {
      if (!seen.has(i)) continue;
      block.surface[i].sdf = kSdfMax;
      block.record[i] = seen_often(seen.looks);
    }
    remove(*ref);
  }
  *ref = id;
  view_.block_keys[id] = key;
  view_.settled_free[id] = 0;
  note_peak();
  return {Insert::inserted, id};
}

bool MapStorage::see_group_free(Int3 group) {
  const BlockKey key = pack(group);
  BlockRef* const ref = view_.table.slot_of(key);
  if (ref && (has_id(*ref) || is_archived(*ref))) return false;
  if (ref && is_free(*ref)) {
    *ref = free_ref(looks_more(payload(*ref)));
    return true;
  }
  const InsertResult made = view_.table.insert(key, view_.group_pool);
  if (!count(made.answer)) return false;
  ++table_entries_;
  *view_.table.slot_of(key) = free_ref(1);
  view_.group_pool.give_back(made.block);
  note_peak();
  return true;
}

InsertResult MapStorage::see_free(Int3 block) {
  BlockRef* const ref = open(block);
  if (!ref) return {Insert::pool_empty, kNoBlock};
  if (has_id(*ref)) return {Insert::existed, *ref};
  const uint32_t looks = is_free(*ref)     ? payload(*ref)
                         : is_partly(*ref) ? view_.partly[payload(*ref)].looks
                                           : 0u;
  remove(*ref);
  *ref = free_ref(looks_more(looks));
  return {Insert::existed, kNoBlock};
}

InsertResult MapStorage::see_partly(Int3 block) {
  BlockRef* const ref = open(block);
  if (!ref) return {Insert::pool_empty, kNoBlock};
  if (has_id(*ref) || is_free(*ref)) return {Insert::existed, kNoBlock};
  if (is_partly(*ref)) {
    SeenVoxels& seen = view_.partly[payload(*ref)];
    seen.looks = looks_more(seen.looks);
    return {Insert::existed, payload(*ref)};
  }
  const uint32_t id = view_.partly_pool.take();
  if (id == kNoBlock) {
    count(Insert::pool_empty);
    return {Insert::pool_empty, kNoBlock};
  }
  view_.partly[id] = {{}, pack(block), 1};
  *ref = kPartlyRef | id;
  note_peak();
  return {Insert::inserted, id};
}

void MapStorage::release_voxels(BlockId id) {
  const Int3 at = unpack(view_.block_keys[id]);
  const VoxelBlock& block = view_.blocks[id];
  SeenVoxels seen = {};
  uint32_t looks = 255;
  for (int32_t i = 0; i < kBlockVoxels; ++i) {
    if (block.surface[i].sdf == kSdfUnobserved) continue;
    seen.layer[i >> 6] |= 1ull << (i & 63);
    looks = std::min<uint32_t>(looks, block.record[i].weight);
  }
  BlockRef* const ref = open(at);
  if (!ref) return;
  if (seen.all()) {
    *ref = free_ref(std::min(looks, enough_));
  } else {
    const uint32_t partly = view_.partly_pool.take();
    if (partly == kNoBlock) return;  // it keeps its voxels
    seen.key = view_.block_keys[id];
    seen.looks = std::min(looks, enough_);
    view_.partly[partly] = seen;
    *ref = kPartlyRef | partly;
  }
  remove(id);
}

void MapStorage::release_partly(uint32_t id) {
  const SeenVoxels& seen = view_.partly[id];
  if (!seen.all()) return;
  BlockRef* const ref = open(unpack(seen.key));
  *ref = free_ref(seen.looks);
  remove(kPartlyRef | id);
}

void MapStorage::merge_group(Int3 group) {
  BlockRef* const ref = view_.table.slot_of(pack(group));
  if (!ref || !has_id(*ref)) return;
  for (const BlockRef block : view_.groups[*ref].block)
    if (!is_free(block) || payload(block) < enough_) return;
  view_.group_pool.give_back(*ref);
  *ref = free_ref(enough_);
}

uint32_t MapStorage::list_groups(View<BlockKey> keys) const {
  uint32_t count = 0;
  for (uint32_t slot = 0; slot < view_.table.keys.size; ++slot) {
    const BlockRef group = view_.table.blocks[slot];
    if (view_.table.keys[slot] == kEmptyKey || group == kNoBlock || is_archived(group)) continue;
    if (count < keys.size) keys[count] = view_.table.keys[slot];
    ++count;
  }
  std::sort(keys.begin(), keys.begin() + std::min(count, keys.size));
  return count;
}

uint32_t MapStorage::write_group(BlockKey key, View<uint8_t> record) const {
  const BlockRef group = view_.table.find(key);
  if (group == kNoBlock || is_archived(group) || record.size < sizeof(GroupRecordHead)) return 0;
  GroupRecordHead head = {key, sizeof head, is_free(group) ? payload(group) : 0u, {}, {}, {}};
  for (int32_t i = 0; has_id(group) && i < kGroupBlocks; ++i) {
    const BlockRef block = view_.groups[group].block[i];
    BlockKind kind = BlockKind::unknown;
    const uint8_t* from = nullptr;
    if (has_id(block)) {
      kind = BlockKind::voxels;
      head.settled[i] = view_.settled_free[block];
      from = reinterpret_cast<const uint8_t*>(&view_.blocks[block]);
    } else if (is_free(block)) {
      kind = BlockKind::free;
      head.looks[i] = static_cast<uint8_t>(payload(block));
    } else if (is_partly(block)) {
      const SeenVoxels& seen = view_.partly[payload(block)];
      kind = BlockKind::partly;
      head.looks[i] = static_cast<uint8_t>(seen.looks);
      from = reinterpret_cast<const uint8_t*>(seen.layer);
    }
    head.kind[i] = static_cast<uint8_t>(kind);
    const uint32_t bytes = payload_bytes(kind);
    if (record.size - head.bytes < bytes) return 0;
    if (from) std::memcpy(record.data + head.bytes, from, bytes);
    head.bytes += bytes;
  }
  std::memcpy(record.data, &head, sizeof head);
  return head.bytes;
}

bool MapStorage::has_room_for(const GroupRecordHead& head) const {
  uint32_t voxels = 0, partly = 0;
  for (const uint8_t kind : head.kind) {
    voxels += static_cast<BlockKind>(kind) == BlockKind::voxels;
    partly += static_cast<BlockKind>(kind) == BlockKind::partly;
  }
  const auto room = [](uint32_t wanted, const PoolView& pool) {
    return wanted <= pool.free_ids.size - *pool.used;
  };
  return room(voxels, view_.pool) && room(partly, view_.partly_pool) && room(1, view_.group_pool);
}

void MapStorage::read_block(const GroupRecordHead& head, int32_t index, const uint8_t*& from, BlockRef& ref) {
  const auto kind = static_cast<BlockKind>(head.kind[index]);
  const BlockKey key = pack(block_in_group(unpack(head.group), index));
  ref = kNoBlock;
  if (kind == BlockKind::voxels) {
    ref = view_.pool.take();
    std::memcpy(&view_.blocks[ref], from, sizeof(VoxelBlock));
    view_.block_keys[ref] = key;
    view_.settled_free[ref] = head.settled[index];
  } else if (kind == BlockKind::free) {
    ref = free_ref(head.looks[index]);
  } else if (kind == BlockKind::partly) {
    const uint32_t id = view_.partly_pool.take();
    SeenVoxels& seen = view_.partly[id];
    std::memcpy(seen.layer, from, kSeenBytes);
    seen.key = key;
    seen.looks = head.looks[index];
    seen.grew = true;
    ref = kPartlyRef | id;
  }
  from += payload_bytes(kind);
}

Status MapStorage::read_group(View<const uint8_t> record) {
  GroupRecordHead head;
  if (!read_head(record, head)) return Status::bad_data;
  if (!has_room_for(head)) return Status::capacity_exhausted;
  BlockGroup* const group = open_group(unpack(head.group));
  if (!group) return Status::capacity_exhausted;
  const uint8_t* from = record.data + sizeof head;
  for (int32_t i = 0; i < kGroupBlocks; ++i) {
    remove(group->block[i]);
    read_block(head, i, from, group->block[i]);
  }
  if (head.uniform_looks > 0) {
    BlockRef* const ref = view_.table.slot_of(head.group);
    view_.group_pool.give_back(*ref);
    *ref = free_ref(head.uniform_looks);
  }
  note_peak();
  return Status::ok;
}

float MapStorage::fill() const {
  const auto share = [](uint32_t used, uint32_t capacity) {
    return static_cast<float>(used) / static_cast<float>(std::max(capacity, 1u));
  };
  return std::max({share(used_[0], view_.pool.free_ids.size), share(used_[1], view_.group_pool.free_ids.size),
                   share(used_[2], view_.partly_pool.free_ids.size)});
}

bool MapStorage::above_high_water() const {
  const auto entries = static_cast<float>(most_entries(view_.table.keys.size));
  return fill() > high_water_ || static_cast<float>(table_entries_) > high_water_ * entries;
}

uint32_t MapStorage::farthest_of_order(Vec3 centre_map, uint32_t count, View<BlockKey> keys) {
  const uint32_t wanted = std::min(count, keys.size);
  std::partial_sort(order_.begin(), order_.begin() + wanted, order_.begin() + count,
                    FartherGroup{centre_map, view_.voxel_m});
  for (uint32_t i = 0; i < wanted; ++i) keys[i] = order_[i].key;
  return wanted;
}

void MapStorage::put_away(BlockKey key, uint32_t entry) {
  BlockRef* const ref = view_.table.slot_of(key);
  if (!ref || !has_id(*ref)) return;
  for (const BlockRef block : view_.groups[*ref].block) remove(block);
  view_.group_pool.give_back(*ref);
  *ref = archived_ref(entry);
  ++health_.archived_groups;
}

void MapStorage::forget_group(BlockKey key) {
  BlockRef* const ref = view_.table.slot_of(key);
  if (!ref || !is_archived(*ref)) return;
  *ref = kNoBlock;
  --table_entries_;
  --health_.archived_groups;
}

/// All groups of the table, into `order_`.
uint32_t MapStorage::order_groups() {
  uint32_t count = 0;
  for (uint32_t slot = 0; slot < view_.table.keys.size; ++slot)
    if (view_.table.keys[slot] != kEmptyKey && view_.table.blocks[slot] != kNoBlock)
      order_[count++] = {view_.table.keys[slot], view_.table.blocks[slot], 0};
  return count;
}

/// Gives back what a block holds.
void MapStorage::remove(BlockRef block) {
  if (has_id(block)) {
    view_.block_keys[block] = kEmptyKey;
    view_.pool.give_back(block);
  } else if (is_partly(block)) {
    view_.partly[payload(block)].key = kEmptyKey;
    view_.partly_pool.give_back(payload(block));
  }
}

void MapStorage::give_up(const GroupEntry& group) {
  health_.archived_groups -= is_archived(group.ref);
  health_.dropped_blocks += is_archived(group.ref);  // one at least
  if (!has_id(group.ref)) return;
  for (const BlockRef block : view_.groups[group.ref].block) {
    health_.dropped_blocks += has_id(block);
    remove(block);
  }
  view_.group_pool.give_back(group.ref);
}

void MapStorage::drop_ordered(Vec3 centre_map, uint32_t groups) {
  const bool any_kind = !has_room(groups, most_entries(view_.table.keys.size));
  std::sort(order_.begin(), order_.begin() + groups, KeptLonger{{centre_map, view_.voxel_m}, any_kind});
  while (groups > 0 && !(has_room(used_[0], view_.pool.free_ids.size) &&
                         has_room(used_[1], view_.group_pool.free_ids.size) &&
                         has_room(used_[2], view_.partly_pool.free_ids.size) &&
                         has_room(groups, most_entries(view_.table.keys.size))))
    give_up(order_[--groups]);
  rebuild_table(groups);
}

/// Makes the table anew from `order_`: it has no removal of single keys.
void MapStorage::rebuild_table(uint32_t groups) {
  std::fill(view_.table.keys.begin(), view_.table.keys.end(), kEmptyKey);
  std::fill(view_.table.blocks.begin(), view_.table.blocks.end(), kNoBlock);
  table_entries_ = 0;
  for (uint32_t i = 0; i < groups; ++i) {
    if (view_.table.put(order_[i].key, order_[i].ref)) {
      ++table_entries_;
    } else {
      ++health_.table_full;
      give_up(order_[i]);
    }
  }
}

}  // namespace stillmap
