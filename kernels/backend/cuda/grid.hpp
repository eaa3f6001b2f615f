#pragma once

// How kernels are written: over a `Block`, the lanes that share memory and can wait for each other. CudaBlock
// (cuda_device.cuh) is a thread block of the GPU; EmulatedBlock (tests/support/emulated_grid.hpp) runs the
// same source on the CPU, in the tests.
//
// A kernel is a plain struct of views and parameters with
//   static constexpr uint32_t kLanes     lanes of a block, a multiple of kWarp
//   struct Shared                        memory that the lanes of a block share; not initialised
//   void operator()(Block&) const        run by every block
//
// Everything that differs from lane to lane stands inside `each` or `privately`; what stands outside must be
// the same for all lanes of a block. That makes a barrier that only some lanes reach impossible.
//   block.index(), block.count()         which block of how many
//   block.each(f)                        f(lane) for every lane, then a barrier
//   block.privately(f)                   f(lane) without a barrier: reads nothing that another lane writes
//   here PerLane<Block, T> x; x[lane]         a value that a lane keeps; in registers on the GPU
//   block.shuffle_down(x, n)             PerLane: the value of lane + n of the same warp, else the own one
//   block.shuffle_up(x, n)               PerLane: the value of lane - n of the same warp, else the own one
//   block.ballot(x)                      PerLane: bit i for lane i of the same warp where x is not 0
//   block.fence()                        what was written is seen by the other blocks before what follows
//   block.shared()                       Shared&

#include <cstdint>

#include "kernels/base/atomic.hpp"
#include "kernels/base/hd.hpp"

namespace stillmap {

constexpr uint32_t kWarp = 32;

template <class Block, class T>
using PerLane = typename Block::template PerLane<T>;

struct NoShared {};

/// Blocks that cover `count` elements, one a lane.
constexpr uint32_t blocks_for(uint64_t count, uint32_t lanes) {
  return static_cast<uint32_t>((count + lanes - 1) / lanes);
}

/// Calls f(i) for i in [0, count), spread over all lanes of all blocks.
template <class Block, class F>
STILLMAP_GRID void for_all(Block& block, uint32_t count, const F& f) {
  block.each([&](uint32_t lane) {
    for (uint32_t i = block.index() * Block::kLanes + lane; i < count; i += block.count() * Block::kLanes)
      f(i);
  });
}
/// The same over the lanes of one block.
template <class Block, class F>
STILLMAP_GRID void for_all_in_block(Block& block, uint32_t count, const F& f) {
  block.each([&](uint32_t lane) {
    for (uint32_t i = lane; i < count; i += Block::kLanes) f(i);
  });
}

/// True in all lanes of the block that is the last one to come here; what the others wrote before can be read
/// then. Which block that is changes nothing that the caller computes.
/// @param arrived 0 before the launch, and again after it; @param last in shared memory
template <class Block>
STILLMAP_GRID bool is_last_block(Block& block, uint32_t* arrived, bool& last) {
  block.fence();
  block.each([](uint32_t) {});  // all lanes have written
  block.each([&](uint32_t lane) {
    if (lane != 0) return;
    last = atomic_add(arrived, 1u) == block.count() - 1;
    if (last) *arrived = 0;
  });
  block.fence();
  return last;
}

/// Sum over the block in an order that does not change.
/// @param warps room for kLanes / kWarp values, in shared memory  @return the sum, in every lane
template <class Block, class T>
STILLMAP_GRID T sum_over_block(Block& block, PerLane<Block, T> x, T* warps) {
  for (uint32_t n = kWarp / 2; n > 0; n /= 2) {
    const PerLane<Block, T> other = block.shuffle_down(x, n);
    block.privately([&](uint32_t lane) { x[lane] = x[lane] + other[lane]; });
  }
  block.each([&](uint32_t lane) {
    if (lane % kWarp == 0) warps[lane / kWarp] = x[lane];
  });
  T sum = warps[0];
  for (uint32_t w = 1; w < Block::kLanes / kWarp; ++w) sum = sum + warps[w];
  block.each([](uint32_t) {});  // `warps` may be used again
  return sum;
}

/// Replaces every lane's value by the sum of those of the lanes before it.
/// @param warps room for kLanes / kWarp values, in shared memory  @return the sum of all
template <class Block, class T>
STILLMAP_GRID T scan_block(Block& block, PerLane<Block, T>& x, T* warps) {
  PerLane<Block, T> sum = x;  // up to and with the own one, within the warp
  for (uint32_t n = 1; n < kWarp; n *= 2) {
    const PerLane<Block, T> other = block.shuffle_up(sum, n);
    block.privately([&](uint32_t lane) {
      if (lane % kWarp >= n) sum[lane] = sum[lane] + other[lane];
    });
  }
  block.each([&](uint32_t lane) {
    if (lane % kWarp == kWarp - 1) warps[lane / kWarp] = sum[lane];
  });
  block.privately([&](uint32_t lane) {
    T before = sum[lane] - x[lane];
    for (uint32_t w = 0; w < lane / kWarp; ++w) before = before + warps[w];
    x[lane] = before;
  });
  T all = warps[0];
  for (uint32_t w = 1; w < Block::kLanes / kWarp; ++w) all = all + warps[w];
  block.each([](uint32_t) {});  // `warps` may be used again
  return all;
}

}  // namespace stillmap
