#include "kernels/backend/cpu/map_storage.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace stillmap {
namespace {

/// Twice as many slots as blocks: chains stay short.
uint64_t table_slots(int32_t pool_blocks) {
  return std::bit_ceil(2u * static_cast<uint32_t>(pool_blocks));
}

void make_unobserved(VoxelBlock& block) {
  std::fill_n(block.surface, kBlockVoxels, VoxelSurface{});
  std::fill_n(block.record, kBlockVoxels, VoxelRecord{});
}

float distance2(Vec3 centre_map, BlockKey key, float voxel_m) {
  const Vec3 d = voxel_position(first_voxel(unpack(key)) + Int3{4, 4, 4}, voxel_m) - centre_map;
  return dot(d, d);
}

}  // namespace

void MapStorage::carve(Arena& arena, const MapParams& params) {
  const uint64_t blocks = static_cast<uint64_t>(params.pool_blocks), slots = table_slots(params.pool_blocks);
  view_.voxel_m = params.voxel_m;
  view_.truncation_m = params.truncation_m;
  view_.mesh_min_weight = params.mesh_min_weight;
  view_.mesh_min_surface = params.mesh_min_surface;
  view_.table.keys = arena.take<BlockKey>("map: block table", slots);
  view_.table.blocks = arena.take<BlockId>("map: block table", slots);
  view_.blocks = arena.take<VoxelBlock>("map: voxel blocks", blocks);
  view_.block_keys = arena.take<BlockKey>("map: block lists", blocks);
  view_.settled_free = arena.take<uint8_t>("map: block lists", blocks);
  view_.pool.free_ids = arena.take<BlockId>("map: block lists", blocks);
  order_ = arena.take<BlockId>("map: block lists", blocks);
  used_ = arena.take<uint32_t>("map: block lists", 1);
  view_.pool.used = used_.data;
  high_water_blocks_ = static_cast<uint32_t>(params.high_water * static_cast<float>(params.pool_blocks));
  health_.capacity = static_cast<uint32_t>(blocks);
}

void MapStorage::clear_table() {
  std::fill(view_.table.keys.begin(), view_.table.keys.end(), kEmptyKey);
  std::fill(view_.table.blocks.begin(), view_.table.blocks.end(), kNoBlock);
}

void MapStorage::clear() {
  clear_table();
  std::fill(view_.block_keys.begin(), view_.block_keys.end(), kEmptyKey);
  for (uint32_t i = 0; i < view_.pool.free_ids.size; ++i) view_.pool.free_ids[i] = i;
  used_[0] = 0;
}

MapHealth MapStorage::health() const {
  MapHealth h = health_;
  h.blocks = used_[0];
  h.bytes = static_cast<uint64_t>(h.peak_blocks) * (sizeof(VoxelBlock) + sizeof(BlockKey) + sizeof(BlockId));
  return h;
}

InsertResult MapStorage::insert(BlockKey key) {
  const InsertResult result = view_.table.insert(key, view_.pool);
  switch (result.answer) {
    case Insert::existed:
      break;
    case Insert::inserted:
      make_unobserved(view_.blocks[result.block]);
      view_.block_keys[result.block] = key;
      view_.settled_free[result.block] = 0;
      health_.peak_blocks = std::max(health_.peak_blocks, used_[0]);
      break;
    case Insert::contended:
      ++health_.contended;
      break;
    case Insert::table_full:
      ++health_.table_full;
      break;
    case Insert::pool_empty:
      ++health_.pool_empty;
      break;
  }
  return result;
}

void MapStorage::drop_farthest(Vec3 centre_map) {
  const uint32_t capacity = view_.pool.free_ids.size, keep = capacity - capacity / 10;
  uint32_t used = 0;
  for (BlockId id = 0; id < capacity; ++id)
    if (view_.block_keys[id] != kEmptyKey) order_[used++] = id;
  if (used <= keep) return;
  // Ties by key: the same blocks go whatever their ids.
  const auto nearer = [&](BlockId a, BlockId b) {
    const BlockKey ka = view_.block_keys[a], kb = view_.block_keys[b];
    const float da = distance2(centre_map, ka, view_.voxel_m), db = distance2(centre_map, kb, view_.voxel_m);
    return da != db ? da < db : ka < kb;
  };
  std::nth_element(order_.begin(), order_.begin() + keep, order_.begin() + used, nearer);
  for (uint32_t i = keep; i < used; ++i) view_.block_keys[order_[i]] = kEmptyKey;
  health_.dropped_blocks += used - keep;

  rebuild_table();
}

void MapStorage::rebuild_table() {
  clear_table();
  used_[0] = 0;
  for (BlockId id = 0; id < view_.block_keys.size; ++id) {
    if (view_.block_keys[id] == kEmptyKey) continue;
    view_.pool.free_ids[used_[0]] = id;  // the next that the pool gives
    if (view_.table.insert(view_.block_keys[id], view_.pool).answer == Insert::inserted) continue;
    view_.block_keys[id] = kEmptyKey;
    ++health_.table_full;
  }
  uint32_t tail = used_[0];
  for (BlockId id = 0; id < view_.block_keys.size; ++id)
    if (view_.block_keys[id] == kEmptyKey) view_.pool.free_ids[tail++] = id;
}

}  // namespace stillmap
