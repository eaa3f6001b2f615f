#pragma once

// The grid of kernels/backend/cuda/grid.hpp on the CPU: blocks one after the other, the lanes of a block
// between two barriers one after the other, both in an order that a test chooses. A kernel whose result
// depends on that order has a race. Shared memory begins as garbage in every block.

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <random>
#include <vector>

#include "kernels/backend/cuda/grid.hpp"

namespace stillmap {

enum class LaneOrder { rising, falling, shuffled };

template <class Kernel>
class EmulatedBlock {
 public:
  static constexpr uint32_t kLanes = Kernel::kLanes;
  static_assert(kLanes % kWarp == 0);

  template <class T>
  class PerLane {
   public:
    T& operator[](uint32_t lane) { return value_[lane]; }
    const T& operator[](uint32_t lane) const { return value_[lane]; }

   private:
    std::array<T, kLanes> value_{};
  };

  EmulatedBlock(uint32_t index, uint32_t count, const std::array<uint32_t, kLanes>& order)
      : index_(index), count_(count), order_(order) {
    std::memset(shared_, 0xa5, sizeof shared_);
  }

  uint32_t index() const { return index_; }
  uint32_t count() const { return count_; }
  typename Kernel::Shared& shared() { return *reinterpret_cast<typename Kernel::Shared*>(shared_); }
  void fence() const {}

  template <class F>
  void each(const F& f) const {
    for (const uint32_t lane : order_) f(lane);
  }
  template <class F>
  void privately(const F& f) const {
    each(f);
  }
  template <class T>
  PerLane<T> shuffle_down(const PerLane<T>& x, uint32_t n) const {
    PerLane<T> out;
    for (uint32_t lane = 0; lane < kLanes; ++lane) out[lane] = x[lane % kWarp + n < kWarp ? lane + n : lane];
    return out;
  }
  template <class T>
  PerLane<T> shuffle_up(const PerLane<T>& x, uint32_t n) const {
    PerLane<T> out;
    for (uint32_t lane = 0; lane < kLanes; ++lane) out[lane] = x[lane % kWarp >= n ? lane - n : lane];
    return out;
  }
  PerLane<uint32_t> ballot(const PerLane<uint32_t>& x) const {
    PerLane<uint32_t> out;
    for (uint32_t lane = 0; lane < kLanes; ++lane)
      for (uint32_t i = 0; i < kWarp; ++i)
        out[lane] |= static_cast<uint32_t>(x[lane / kWarp * kWarp + i] != 0) << i;
    return out;
  }

 private:
  uint32_t index_, count_;
  const std::array<uint32_t, kLanes>& order_;
  alignas(64) unsigned char shared_[sizeof(typename Kernel::Shared)];
};

namespace emulated_detail {

inline void put_in_order(uint32_t* first, uint32_t* last, LaneOrder order, uint32_t seed) {
  std::iota(first, last, 0u);
  if (order == LaneOrder::falling) std::reverse(first, last);
  if (order == LaneOrder::shuffled) std::shuffle(first, last, std::mt19937(seed));
}

}  // namespace emulated_detail

/// Runs a kernel as a launch of `blocks` blocks would.
template <class Kernel>
void run_emulated(uint32_t blocks, const Kernel& kernel, LaneOrder order = LaneOrder::rising) {
  std::array<uint32_t, Kernel::kLanes> lanes;
  std::vector<uint32_t> turns(blocks);
  emulated_detail::put_in_order(turns.data(), turns.data() + blocks, order, 1);
  emulated_detail::put_in_order(lanes.data(), lanes.data() + lanes.size(), order, 2);
  for (const uint32_t index : turns) {
    EmulatedBlock<Kernel> block(index, blocks, lanes);
    kernel(block);
  }
}

}  // namespace stillmap
