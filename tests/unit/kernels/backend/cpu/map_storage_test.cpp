#include "kernels/backend/cpu/map_storage.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <set>
#include <vector>

namespace stillmap {
namespace {

constexpr auto kNothingInView = [](BlockKey) { return false; };

/// A MapStorage with its memory.
class Storage {
 public:
  explicit Storage(const MapParams& params) : arena_(bytes(params)) {
    map.carve(arena_, params, 64);
    map.clear();
  }
  MapStorage map;

 private:
  static uint64_t bytes(const MapParams& params) {
    Arena measure;
    MapStorage plan;
    plan.carve(measure, params, 64);
    return measure.items().total_bytes;
  }
  Arena arena_;
};

MapParams params_of(int32_t pool_blocks) {
  MapParams p;
  p.pool_blocks = pool_blocks;
  return p;
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
    EXPECT_EQ(map.view().ref_of({1, -1, round}), kNoBlock);
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
  // Two groups: x 0..3 and 4..7.
  EXPECT_EQ(health.bytes, 5 * (sizeof(VoxelBlock) + sizeof(BlockKey) + 1) +
                              2 * (sizeof(BlockGroup) + sizeof(BlockKey) + sizeof(BlockRef)));
  map.clear();
  map.insert(pack({1, 1, 1}));
  health = map.health();
  EXPECT_EQ(health.blocks, 1u);
  EXPECT_EQ(health.peak_blocks, 5u);
  // Five groups at most, in a table of 16 slots.
  for (int32_t i = 0; i < 100; ++i) map.insert(pack({4 * i, 5, 5}));
  EXPECT_EQ(map.health().blocks, 5u);
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

float distance_of_group_m(BlockKey block, Vec3 from) {
  const Int3 first = first_voxel(block_in_group(group_of_block(unpack(block)), 0));
  return norm(voxel_position(first + Int3{16, 16, 16}, 0.01f) - from);
}

TEST(MapStorage, DropFarthestKeepsTheNearestGroupsAndMakesATenthFree) {
  Storage storage(params_of(1000));
  MapStorage& map = storage.map;
  const std::vector<BlockKey> keys = fill(map, 1000, 3);
  const Vec3 centre = {0.2f, -0.1f, 0.3f};
  map.drop_farthest(centre, kNothingInView);
  EXPECT_LE(map.health().blocks, 900u);
  EXPECT_GT(map.health().blocks, 900u - kGroupBlocks);
  EXPECT_EQ(map.health().dropped_blocks, 1000u - map.health().blocks);
  EXPECT_EQ(map.health().peak_blocks, 1000u);
  float farthest_kept_m = 0, nearest_dropped_m = 1e9f;
  for (const BlockKey key : keys) {
    const BlockId id = map.view().voxels_of(unpack(key));
    if (id == kNoBlock) {
      nearest_dropped_m = std::min(nearest_dropped_m, distance_of_group_m(key, centre));
      continue;
    }
    farthest_kept_m = std::max(farthest_kept_m, distance_of_group_m(key, centre));
    EXPECT_EQ(map.view().block_keys[id], key);
    EXPECT_EQ(map.view().blocks[id].surface[7].sdf, static_cast<int16_t>(key & 0x7fff));  // its own voxels
  }
  EXPECT_LE(farthest_kept_m, nearest_dropped_m + 1e-6f);
}

TEST(MapStorage, DropFarthestKeepsWhatIsInViewHoweverFar) {
  Storage storage(params_of(1000));
  MapStorage& map = storage.map;
  const std::vector<BlockKey> keys = fill(map, 1000, 3);
  const Vec3 centre = {0.2f, -0.1f, 0.3f};
  const auto in_view = [&](BlockKey group) { return unpack(group).x > 0; };  // about half of them
  map.drop_farthest(centre, in_view);
  EXPECT_LE(map.health().blocks, 900u);
  uint32_t kept_out_of_view = 0;
  for (const BlockKey key : keys) {
    const bool kept = map.view().voxels_of(unpack(key)) != kNoBlock;
    const bool seen = in_view(pack(group_of_block(unpack(key))));
    EXPECT_TRUE(kept || !seen);
    kept_out_of_view += kept && !seen;
  }
  EXPECT_GT(kept_out_of_view, 100u);
}

TEST(MapStorage, DroppedBlocksCanBeHadAgain) {
  Storage storage(params_of(1000));
  MapStorage& map = storage.map;
  fill(map, 1000, 4);
  EXPECT_EQ(map.insert(pack({50, 0, 0})).answer, Insert::pool_empty);
  map.drop_farthest({}, kNothingInView);
  const auto room = static_cast<int32_t>(1000 - map.health().blocks);
  std::set<BlockId> ids;
  for (int32_t i = 0; i < room; ++i) {
    const InsertResult r = map.insert(pack({50, i, 0}));
    ASSERT_EQ(r.answer, Insert::inserted);
    EXPECT_EQ(map.view().blocks[r.block].surface[7].sdf, kSdfUnobserved);
    ids.insert(r.block);
  }
  EXPECT_EQ(static_cast<int32_t>(ids.size()), room);
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
      storage.map.drop_farthest({}, kNothingInView);
      kept[seed - 5] = keys_of(storage.map);
    }
    EXPECT_LE(kept[0].size(), count - count / 10);
    EXPECT_EQ(kept[0], kept[1]);
  }
}

TEST(MapStorage, NothingIsDroppedWhereThereIsRoom) {
  Storage storage(params_of(1000));
  fill(storage.map, 900, 7);
  storage.map.drop_farthest({100, 100, 100}, kNothingInView);
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
    if (map.above_high_water())
      map.drop_farthest({0.08f * static_cast<float>(coordinate(random)), 0, 0}, kNothingInView);
    const std::set<BlockKey> keys = keys_of(map);
    ASSERT_EQ(keys.size(), map.health().blocks);
    for (const BlockKey key : keys) {
      const BlockId id = map.view().voxels_of(unpack(key));
      ASSERT_NE(id, kNoBlock);
      ASSERT_EQ(map.view().block_keys[id], key);
    }
  }
  EXPECT_GT(map.health().dropped_blocks, 100u);
}

// --- the archive's side ---

TEST(MapStorage, AGroupPutAwayIsUnknownAndItsBlocksCanBeHadAgain) {
  Storage storage(params_of(100));
  MapStorage& map = storage.map;
  for (int32_t i = 0; i < 5; ++i) map.insert(pack({i, 0, 0}));  // two groups
  map.put_away(pack({0, 0, 0}), 77);
  EXPECT_EQ(map.health().blocks, 1u);
  EXPECT_EQ(map.health().archived_groups, 1u);
  EXPECT_EQ(map.view().table.find(pack({0, 0, 0})), archived_ref(77));
  EXPECT_EQ(map.view().ref_of({1, 0, 0}), kNoBlock);
  EXPECT_FALSE(map.view().read({1, 0, 0}));
  std::vector<BlockKey> keys(10);
  EXPECT_EQ(map.list_groups({keys.data(), 10}), 1u);
  EXPECT_EQ(keys[0], pack({1, 0, 0}));
  EXPECT_FALSE(map.see_group_free({0, 0, 0}));
  map.forget_group(pack({0, 0, 0}));
  EXPECT_EQ(map.health().archived_groups, 0u);
  EXPECT_EQ(map.insert(pack({1, 0, 0})).answer, Insert::inserted);
}

TEST(MapStorage, AGroupThatComesBackIsAsItWas) {
  Storage storage(params_of(100));
  MapStorage& map = storage.map;
  const BlockId id = map.insert(pack({2, 1, 0})).block;
  map.view().blocks[id].surface[9].sdf = 1234;
  std::vector<uint8_t> record(kMaxGroupRecordBytes);
  const uint32_t bytes = map.write_group(pack({0, 0, 0}), {record.data(), kMaxGroupRecordBytes});
  map.put_away(pack({0, 0, 0}), 3);
  EXPECT_EQ(map.health().blocks, 0u);
  ASSERT_EQ(map.read_group({record.data(), bytes}), Status::ok);
  EXPECT_EQ(map.health().blocks, 1u);
  EXPECT_EQ(map.health().archived_groups, 0u);
  EXPECT_EQ(map.view().blocks[map.view().voxels_of({2, 1, 0})].surface[9].sdf, 1234);
}

TEST(MapStorage, TheFarthestGroupsComeFirstAndThoseToKeepNotAtAll) {
  Storage storage(params_of(100));
  MapStorage& map = storage.map;
  for (int32_t i = 0; i < 10; ++i) map.insert(pack({4 * i, 0, 0}));
  const auto keep_odd = [](BlockKey group) { return unpack(group).x % 2 != 0; };
  std::vector<BlockKey> keys(3);
  ASSERT_EQ(map.farthest_groups({}, {keys.data(), 3}, keep_odd), 3u);
  EXPECT_EQ(keys, (std::vector<BlockKey>{pack({8, 0, 0}), pack({6, 0, 0}), pack({4, 0, 0})}));
  keys.resize(100);
  EXPECT_EQ(map.farthest_groups({}, {keys.data(), 100}, keep_odd), 5u);
}

// --- free space without voxels ---

MapParams hierarchical(int32_t pool_blocks) {
  MapParams p = params_of(pool_blocks);
  p.free_space = FreeSpace::hierarchical;
  return p;
}
int16_t sdf_at(const MapStorage& map, Int3 voxel) {
  const BlockAt block = map.view().read(block_of_voxel(voxel));
  return block ? block.surface(index_in_block(voxel)).sdf : kSdfUnobserved;
}

TEST(FreeSpace, AFreeGroupTakesATableEntryAndAFreeBlockAWord) {
  Storage storage(hierarchical(10));
  MapStorage& map = storage.map;
  EXPECT_TRUE(map.see_group_free({2, -1, 0}));
  EXPECT_EQ(map.health().bytes, sizeof(BlockKey) + sizeof(BlockRef));
  EXPECT_EQ(sdf_at(map, {64, -1, 31}), kSdfMax);
  EXPECT_EQ(sdf_at(map, {64, 0, 31}), kSdfUnobserved);
  const InsertResult one = map.see_free({0, 0, 0});
  EXPECT_EQ(one.answer, Insert::existed);
  EXPECT_EQ(one.block, kNoBlock);
  EXPECT_EQ(sdf_at(map, {7, 7, 7}), kSdfMax);
  EXPECT_EQ(sdf_at(map, {8, 7, 7}), kSdfUnobserved);
  EXPECT_EQ(map.health().blocks, 0u);
  EXPECT_FALSE(map.see_group_free({0, 0, 0}));  // its blocks are not all the same
}

TEST(FreeSpace, VoxelsOfAFreeBlockAreFreeWithTheWeightOfItsLooks) {
  Storage storage(hierarchical(10));
  MapStorage& map = storage.map;
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(map.see_group_free({0, 0, 0}));
  const InsertResult r = map.insert(pack({1, 2, 3}));
  ASSERT_EQ(r.answer, Insert::inserted);
  for (int32_t i = 0; i < kBlockVoxels; ++i) {
    EXPECT_EQ(map.view().blocks[r.block].surface[i].sdf, kSdfMax);
    EXPECT_EQ(map.view().blocks[r.block].record[i].weight, 5);
    EXPECT_EQ(map.view().blocks[r.block].record[i].colour_weight, 0);
  }
  EXPECT_EQ(map.view().ref_of({1, 2, 2}), free_ref(5));  // its neighbours are as free as before
  EXPECT_EQ(map.see_free({1, 2, 3}).block, r.block);     // whose voxels have to be told
}

TEST(FreeSpace, ABlockSeenInPartKnowsWhichPartAndBecomesFreeWhenItWasSeenWhole) {
  Storage storage(hierarchical(10));
  MapStorage& map = storage.map;
  const InsertResult r = map.see_partly({0, 0, -1});
  ASSERT_EQ(r.answer, Insert::inserted);
  SeenVoxels& seen = map.view().partly[r.block];
  seen.layer[2] = 1ull << voxel_index(3, 4, 0);
  EXPECT_EQ(sdf_at(map, {3, 4, -6}), kSdfMax);
  EXPECT_EQ(sdf_at(map, {4, 4, -6}), kSdfUnobserved);
  map.release_partly(r.block);  // not yet
  EXPECT_EQ(sdf_at(map, {4, 4, -6}), kSdfUnobserved);
  EXPECT_EQ(map.see_partly({0, 0, -1}).answer, Insert::existed);
  std::fill_n(seen.layer, kBlockEdge, ~0ull);
  map.release_partly(r.block);
  EXPECT_EQ(map.view().ref_of({0, 0, -1}), free_ref(2));
  EXPECT_EQ(*map.view().partly_pool.used, 0u);
}

TEST(FreeSpace, ASurfaceInABlockSeenInPartKeepsWhatWasSeen) {
  Storage storage(hierarchical(10));
  MapStorage& map = storage.map;
  map.view().partly[map.see_partly({5, 5, 5}).block].layer[0] = 0xff;
  const InsertResult r = map.insert(pack({5, 5, 5}));
  ASSERT_EQ(r.answer, Insert::inserted);
  EXPECT_EQ(map.view().blocks[r.block].surface[7].sdf, kSdfMax);
  EXPECT_EQ(map.view().blocks[r.block].record[7].weight, 1);
  EXPECT_EQ(map.view().blocks[r.block].surface[8].sdf, kSdfUnobserved);
  EXPECT_EQ(*map.view().partly_pool.used, 0u);
}

TEST(FreeSpace, ABlockWithoutASurfaceGivesItsVoxelsBack) {
  Storage storage(hierarchical(10));
  MapStorage& map = storage.map;
  for (const bool whole : {true, false}) {
    const Int3 at = {whole ? 0 : 9, 0, 0};
    const InsertResult r = map.insert(pack(at));
    VoxelBlock& block = map.view().blocks[r.block];
    for (int32_t i = whole ? 0 : 100; i < kBlockVoxels; ++i) {
      block.surface[i].sdf = kSdfMax;
      block.record[i].weight = static_cast<uint8_t>(i == 200 ? 7 : 50);
    }
    map.release_voxels(r.block);
    EXPECT_EQ(map.health().blocks, 0u);
    EXPECT_EQ(map.view().ref_of(at) == free_ref(7), whole);
    const Int3 first = first_voxel(at);
    EXPECT_EQ(sdf_at(map, first), whole ? kSdfMax : kSdfUnobserved);
    EXPECT_EQ(sdf_at(map, first + Int3{7, 7, 7}), kSdfMax);
  }
}

TEST(FreeSpace, AGroupOfWhichAllBlocksAreFreeForGoodIsOneWord) {
  Storage storage(hierarchical(100));
  MapStorage& map = storage.map;
  for (int looks = 0; looks < 64; ++looks) {
    map.merge_group({0, 0, 0});
    EXPECT_EQ(*map.view().group_pool.used, looks > 0);
    for (int32_t i = 0; i < kGroupBlocks; ++i) map.see_free(block_in_group({0, 0, 0}, i));
  }
  map.merge_group({0, 0, 0});
  EXPECT_EQ(*map.view().group_pool.used, 0u);
  EXPECT_EQ(map.view().table.find(pack({0, 0, 0})), free_ref(64));
  EXPECT_TRUE(map.see_group_free({0, 0, 0}));
  EXPECT_EQ(map.view().table.find(pack({0, 0, 0})), free_ref(64));  // more looks say nothing new
}

/// A map with every kind of block, at random.
void fill_at_random(MapStorage& map, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int32_t> coordinate(-6, 5), what(0, 9), any(0, 65535);
  for (int i = 0; i < 600; ++i) {
    const Int3 at = {coordinate(random), coordinate(random), coordinate(random)};
    switch (what(random)) {
      case 0:
        map.see_group_free({at.x, at.y, at.z});
        break;
      case 1:
      case 2: {
        const InsertResult r = map.see_partly(at);
        if (r.block != kNoBlock) map.view().partly[r.block].layer[at.x & 7] |= 1ull << (any(random) & 63);
        break;
      }
      case 3:
      case 4: {
        const InsertResult r = map.insert(pack(at));
        if (r.block != kNoBlock)
          map.view().blocks[r.block].surface[any(random) & 511].sdf = static_cast<int16_t>(any(random));
        break;
      }
      default:
        if (!has_id(map.view().ref_of(at))) map.see_free(at);
    }
  }
}

std::vector<std::vector<uint8_t>> records_of(const MapStorage& map) {
  std::vector<BlockKey> keys(10000);
  keys.resize(map.list_groups({keys.data(), 10000}));
  std::vector<std::vector<uint8_t>> records;
  for (const BlockKey key : keys) {
    std::vector<uint8_t> record(kMaxGroupRecordBytes);
    record.resize(map.write_group(key, {record.data(), kMaxGroupRecordBytes}));
    records.push_back(record);
  }
  return records;
}
View<const uint8_t> view_of(const std::vector<uint8_t>& bytes) {
  return {bytes.data(), static_cast<uint32_t>(bytes.size())};
}

TEST(GroupRecord, WhatIsReadIsWhatWasWritten) {
  for (uint32_t seed = 1; seed <= 5; ++seed) {
    Storage from(hierarchical(400)), to(hierarchical(400));
    fill_at_random(from.map, seed);
    const auto records = records_of(from.map);
    ASSERT_GT(records.size(), 20u);
    for (const bool again : {false, true})  // the second time in place of what is there
      for (const auto& record : records) ASSERT_EQ(to.map.read_group(view_of(record)), Status::ok) << again;
    EXPECT_EQ(records_of(to.map), records);
    EXPECT_EQ(to.map.health().blocks, from.map.health().blocks);
    for (int32_t v = -50; v < 50; ++v)
      EXPECT_EQ(sdf_at(to.map, {v, 3 - v, v / 2}), sdf_at(from.map, {v, 3 - v, v / 2}));
  }
}

TEST(GroupRecord, WhatIsNoRecordIsRefusedAndChangesNothing) {
  Storage from(hierarchical(400)), to(hierarchical(400));
  fill_at_random(from.map, 7);
  for (const auto& record : records_of(from.map)) {
    for (const size_t bytes : {size_t{0}, size_t{100}, sizeof(GroupRecordHead), record.size() - 1}) {
      const std::vector<uint8_t> cut(
          record.begin(), record.begin() + static_cast<std::ptrdiff_t>(std::min(bytes, record.size() - 1)));
      EXPECT_EQ(to.map.read_group(view_of(cut)), Status::bad_data);
    }
    std::vector<uint8_t> bad = record;
    bad[7] |= 0x80;  // bit 63 of the key
    EXPECT_EQ(to.map.read_group(view_of(bad)), Status::bad_data);
    bad = record;
    bad[offsetof(GroupRecordHead, kind) + 5] = 4;
    EXPECT_EQ(to.map.read_group(view_of(bad)), Status::bad_data);
  }
  EXPECT_EQ(to.map.health().blocks, 0u);
  EXPECT_TRUE(records_of(to.map).empty());
}

TEST(GroupRecord, AMapWithoutRoomRefusesAGroupWhole) {
  Storage from(hierarchical(400)), to(hierarchical(3));
  for (int32_t i = 0; i < 4; ++i) from.map.insert(pack({i, 0, 0}));
  to.map.see_group_free({0, 0, 0});
  const auto records = records_of(from.map);
  ASSERT_EQ(records.size(), 1u);
  EXPECT_EQ(to.map.read_group(view_of(records[0])), Status::capacity_exhausted);
  EXPECT_EQ(to.map.view().ref_of({0, 0, 0}), free_ref(1));
}

}  // namespace
}  // namespace stillmap
