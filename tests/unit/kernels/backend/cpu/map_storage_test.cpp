#include "kernels/backend/cpu/map_storage.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <vector>

namespace stillmap {
namespace {

/// A MapStorage with its memory.
class Storage {
 public:
  explicit Storage(const MapParams& params) : arena_(bytes(params)) {
    map.carve(arena_, params);
    map.clear();
  }
  MapStorage map;

 private:
  static uint64_t bytes(const MapParams& params) {
    Arena measure;
    MapStorage plan;
    plan.carve(measure, params);
    return measure.items().total_bytes;
  }
  Arena arena_;
};

MapParams params_of(int32_t pool_blocks) {
  MapParams p;
  p.pool_blocks = pool_blocks;
  return p;
}

float distance_m(BlockKey key, Vec3 from) {
  return norm(voxel_position(first_voxel(unpack(key)) + Int3{4, 4, 4}, 0.01f) - from);
}

std::set<BlockKey> keys_of(const MapStorage& map) {
  std::set<BlockKey> keys;
  for (const BlockKey key : map.view().block_keys)
    if (key != kEmptyKey) keys.insert(key);
  return keys;
}

/// `count` blocks in a ball, in this random order; each marked by its key.
std::vector<BlockKey> fill(MapStorage& map, uint32_t count, uint32_t seed) {
  std::vector<BlockKey> keys;
  for (int32_t z = -6; z < 6; ++z)
    for (int32_t y = -6; y < 6; ++y)
      for (int32_t x = -6; x < 6 && keys.size() < count; ++x) keys.push_back(pack({x, y, z}));
  std::shuffle(keys.begin(), keys.end(), std::mt19937(seed));
  for (const BlockKey key : keys) {
    const InsertResult r = map.insert(key);
    EXPECT_EQ(r.answer, Insert::inserted);
    map.view().blocks[r.block].surface[7].sdf = static_cast<int16_t>(key & 0x7fff);
  }
  return keys;
}

TEST(MapStorage, ANewBlockIsUnobservedAlsoInUsedMemory) {
  Storage storage(params_of(10));
  MapStorage& map = storage.map;
  for (int round = 0; round < 2; ++round) {
    for (int32_t i = 0; i < 10; ++i) {
      const InsertResult r = map.insert(pack({i, -i, round}));
      ASSERT_EQ(r.answer, Insert::inserted);
      VoxelBlock& block = map.view().blocks[r.block];
      for (int32_t v = 0; v < kBlockVoxels; ++v) {
        EXPECT_EQ(block.surface[v].sdf, kSdfUnobserved);
        EXPECT_EQ(block.record[v].weight, 0);
        EXPECT_EQ(block.record[v].colour_weight, 0);
      }
      EXPECT_EQ(map.view().block_keys[r.block], pack({i, -i, round}));
      EXPECT_EQ(map.view().settled_free[r.block], 0);
      std::fill_n(block.surface, kBlockVoxels, VoxelSurface{5, 5});
      std::fill_n(block.record, kBlockVoxels, VoxelRecord{5, 5, 5, 5});
      map.view().settled_free[r.block] = 1;
      EXPECT_EQ(map.insert(pack({i, -i, round})).answer, Insert::existed);
      EXPECT_EQ(block.surface[0].sdf, 5);
    }
    map.clear();
    EXPECT_EQ(map.health().blocks, 0u);
    EXPECT_EQ(map.view().table.find(pack({1, -1, round})), kNoBlock);
  }
}

TEST(MapStorage, CountsWhatDoesNotFitAndItsPeak) {
  Storage storage(params_of(5));
  MapStorage& map = storage.map;
  for (int32_t i = 0; i < 8; ++i) map.insert(pack({i, 0, 0}));
  MapHealth health = map.health();
  EXPECT_EQ(health.capacity, 5u);
  EXPECT_EQ(health.blocks, 5u);
  EXPECT_EQ(health.peak_blocks, 5u);
  EXPECT_EQ(health.pool_empty, 3u);
  EXPECT_EQ(health.contended + health.table_full + health.dropped_blocks, 0u);
  EXPECT_EQ(health.bytes, 5 * (sizeof(VoxelBlock) + sizeof(BlockKey) + sizeof(BlockId)));
  map.clear();
  map.insert(pack({1, 1, 1}));
  health = map.health();
  EXPECT_EQ(health.blocks, 1u);
  EXPECT_EQ(health.peak_blocks, 5u);
  // A table of 16 slots is full after 16 keys, with or without blocks.
  for (int32_t i = 0; i < 100; ++i) map.insert(pack({i, 5, 5}));
  EXPECT_GT(map.health().table_full, 0u);
  EXPECT_EQ(map.health().table_full + map.health().pool_empty, 100u - 4 + 3);
}

TEST(MapStorage, AboveHighWaterWhenFullerThanTheShareAsked) {
  MapParams params = params_of(100);
  params.high_water = 0.5f;
  Storage storage(params);
  fill(storage.map, 50, 1);
  EXPECT_FALSE(storage.map.above_high_water());
  storage.map.insert(pack({100, 100, 100}));
  EXPECT_TRUE(storage.map.above_high_water());
}

TEST(MapStorage, DropFarthestKeepsTheNearestNineTenths) {
  Storage storage(params_of(1000));
  MapStorage& map = storage.map;
  const std::vector<BlockKey> keys = fill(map, 1000, 3);
  const Vec3 centre = {0.2f, -0.1f, 0.3f};
  map.drop_farthest(centre);
  EXPECT_EQ(map.health().blocks, 900u);
  EXPECT_EQ(map.health().dropped_blocks, 100u);
  EXPECT_EQ(map.health().peak_blocks, 1000u);
  float farthest_kept_m = 0, nearest_dropped_m = 1e9f;
  for (const BlockKey key : keys) {
    const BlockId id = map.view().table.find(key);
    if (id == kNoBlock) {
      nearest_dropped_m = std::min(nearest_dropped_m, distance_m(key, centre));
      continue;
    }
    farthest_kept_m = std::max(farthest_kept_m, distance_m(key, centre));
    EXPECT_EQ(map.view().block_keys[id], key);
    EXPECT_EQ(map.view().blocks[id].surface[7].sdf, static_cast<int16_t>(key & 0x7fff));  // its own voxels
  }
  EXPECT_LE(farthest_kept_m, nearest_dropped_m + 1e-6f);
}

TEST(MapStorage, DroppedBlocksCanBeHadAgain) {
  Storage storage(params_of(1000));
  MapStorage& map = storage.map;
  fill(map, 1000, 4);
  EXPECT_EQ(map.insert(pack({50, 0, 0})).answer, Insert::pool_empty);
  map.drop_farthest({});
  std::set<BlockId> ids;
  for (int32_t i = 0; i < 100; ++i) {
    const InsertResult r = map.insert(pack({50, i, 0}));
    ASSERT_EQ(r.answer, Insert::inserted);
    EXPECT_EQ(map.view().blocks[r.block].surface[7].sdf, kSdfUnobserved);
    ids.insert(r.block);
  }
  EXPECT_EQ(ids.size(), 100u);
  EXPECT_EQ(map.insert(pack({51, 0, 0})).answer, Insert::pool_empty);
  EXPECT_EQ(keys_of(map).size(), 1000u);
}

TEST(MapStorage, WhatIsDroppedDoesNotDependOnTheOrderOfTheBlocks) {
  // From the middle of a ball many are at the same distance, also on both sides of the cut.
  for (const uint32_t count : {150u, 330u, 500u, 777u}) {
    std::set<BlockKey> kept[2];
    for (const uint32_t seed : {5u, 6u}) {
      Storage storage(params_of(static_cast<int32_t>(count)));
      fill(storage.map, count, seed);
      storage.map.drop_farthest({});
      kept[seed - 5] = keys_of(storage.map);
    }
    EXPECT_EQ(kept[0].size(), count - count / 10);
    EXPECT_EQ(kept[0], kept[1]);
  }
}

TEST(MapStorage, NothingIsDroppedWhereThereIsRoom) {
  Storage storage(params_of(1000));
  fill(storage.map, 900, 7);
  storage.map.drop_farthest({100, 100, 100});
  EXPECT_EQ(storage.map.health().blocks, 900u);
  EXPECT_EQ(storage.map.health().dropped_blocks, 0u);
}

// Property: after any series of insertions and drops, table, keys and pool agree.
TEST(MapStorage, StaysConsistentOverManyDrops) {
  Storage storage(params_of(300));
  MapStorage& map = storage.map;
  std::mt19937 random(9);
  std::uniform_int_distribution<int32_t> coordinate(-20, 20);
  for (int round = 0; round < 100; ++round) {
    for (int i = 0; i < 50; ++i)
      map.insert(pack({coordinate(random), coordinate(random), coordinate(random)}));
    if (map.above_high_water()) map.drop_farthest({0.08f * static_cast<float>(coordinate(random)), 0, 0});
    const std::set<BlockKey> keys = keys_of(map);
    ASSERT_EQ(keys.size(), map.health().blocks);
    for (const BlockKey key : keys) {
      const BlockId id = map.view().table.find(key);
      ASSERT_NE(id, kNoBlock);
      ASSERT_EQ(map.view().block_keys[id], key);
    }
  }
  EXPECT_GT(map.health().dropped_blocks, 100u);
}

}  // namespace
}  // namespace stillmap
