#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/vec.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

/// Integer grid coordinates of a voxel or of a block.
struct Int3 {
  int32_t x = 0, y = 0, z = 0;
};
STILLMAP_HD Int3 operator+(Int3 a, Int3 b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
STILLMAP_HD bool operator==(Int3 a, Int3 b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

/// Three block coordinates of 21 bits: -1048576..1048575, at 8 cm a block 83 km to each side.
using BlockKey = uint64_t;
constexpr BlockKey kEmptyKey = ~0ull;  ///< bit 63 is never set in a real key
constexpr int32_t kBlockCoordinateLimit = 1 << 20;

STILLMAP_HD BlockKey pack(Int3 block) {
  const auto field = [](int32_t c) { return static_cast<uint64_t>(static_cast<uint32_t>(c) & 0x1fffffu); };
  return field(block.z) << 42 | field(block.y) << 21 | field(block.x);
}
STILLMAP_HD Int3 unpack(BlockKey key) {
  // Shifted to the top and back down: the sign of 21 bits spreads.
  const auto field = [](uint64_t bits) {
    return static_cast<int32_t>(static_cast<uint32_t>(bits << 11)) >> 11;
  };
  return {field(key & 0x1fffffu), field(key >> 21 & 0x1fffffu), field(key >> 42 & 0x1fffffu)};
}

/// Block of a voxel, rounding down also below zero.
STILLMAP_HD Int3 block_of_voxel(Int3 voxel) {
  return {voxel.x >> 3, voxel.y >> 3, voxel.z >> 3};
}
STILLMAP_HD int32_t index_in_block(Int3 voxel) {
  return voxel_index(voxel.x & 7, voxel.y & 7, voxel.z & 7);
}
STILLMAP_HD Int3 first_voxel(Int3 block) {
  return {block.x * kBlockEdge, block.y * kBlockEdge, block.z * kBlockEdge};
}
/// Where the voxel (i, j, k) is sampled: at (i, j, k) voxel_m, map frame.
STILLMAP_HD Vec3 voxel_position(Int3 voxel, float voxel_m) {
  return {static_cast<float>(voxel.x) * voxel_m, static_cast<float>(voxel.y) * voxel_m,
          static_cast<float>(voxel.z) * voxel_m};
}

/// Mixes all bits of a key (finaliser of a 64-bit avalanche hash).
STILLMAP_HD uint64_t hash_of(BlockKey key) {
  uint64_t h = key;
  h ^= h >> 32;
  h *= 0xd6e8feb86659fd93ull;
  h ^= h >> 32;
  h *= 0xd6e8feb86659fd93ull;
  h ^= h >> 32;
  return h;
}

}  // namespace stillmap
