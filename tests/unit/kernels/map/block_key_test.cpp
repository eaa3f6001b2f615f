#include "kernels/map/block_key.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace stillmap {
namespace {

constexpr int32_t kLow = -kBlockCoordinateLimit, kHigh = kBlockCoordinateLimit - 1;

TEST(BlockKey, UnpackUndoesPackAtTheLimitsAndBelowZero) {
  for (const int32_t x : {kLow, -513, -1, 0, 1, 77, kHigh})
    for (const int32_t y : {kLow, -8, -1, 0, 1, kHigh})
      for (const int32_t z : {kLow, -2, -1, 0, 1, kHigh}) {
        const Int3 block = {x, y, z};
        EXPECT_TRUE(unpack(pack(block)) == block) << x << " " << y << " " << z;
        EXPECT_EQ(pack(block) >> 63, 0u);
        EXPECT_NE(pack(block), kEmptyKey);
      }
}

TEST(BlockKey, UnpackUndoesPackAtRandom) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int32_t> coordinate(kLow, kHigh);
  for (int i = 0; i < 100000; ++i) {
    const Int3 block = {coordinate(random), coordinate(random), coordinate(random)};
    ASSERT_TRUE(unpack(pack(block)) == block);
  }
}

TEST(BlockKey, NeighboursHaveDifferentKeysAndHashes) {
  std::set<BlockKey> keys;
  std::set<uint64_t> hashes;
  for (int32_t z = -8; z < 8; ++z)
    for (int32_t y = -8; y < 8; ++y)
      for (int32_t x = -8; x < 8; ++x) {
        keys.insert(pack({x, y, z}));
        hashes.insert(hash_of(pack({x, y, z})));
      }
  EXPECT_EQ(keys.size(), 4096u);
  EXPECT_EQ(hashes.size(), 4096u);
}

TEST(BlockKey, HashSpreadsNeighboursOverASmallTable) {
  int32_t filled[256] = {};
  for (int32_t z = 0; z < 16; ++z)
    for (int32_t y = 0; y < 16; ++y)
      for (int32_t x = 0; x < 16; ++x) ++filled[hash_of(pack({x, y, z})) & 255];
  for (const int32_t n : filled) EXPECT_LT(n, 48);  // 16 on average
}

TEST(BlockKey, VoxelsRoundDownBelowZero) {
  for (int32_t v = -40; v < 40; ++v) {
    const Int3 voxel = {v, -v, v / 2};
    const Int3 block = block_of_voxel(voxel);
    EXPECT_EQ(block.x, v >= 0 ? v / 8 : -((-v + 7) / 8));
    const int32_t i = index_in_block(voxel);
    const Int3 back = first_voxel(block) + Int3{i & 7, i >> 3 & 7, i >> 6};
    EXPECT_TRUE(back == voxel);
  }
  const Vec3 p = voxel_position({-3, 0, 7}, 0.01f);
  EXPECT_FLOAT_EQ(p.x, -0.03f);
  EXPECT_FLOAT_EQ(p.z, 0.07f);
}

}  // namespace
}  // namespace stillmap
