#pragma once

#include <cstdint>

#include "kernels/base/atomic.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

using BlockId = uint32_t;
constexpr BlockId kNoBlock = ~0u;

/// Bounded stock of blocks. `free_ids[used..capacity)` are free.
struct PoolView {
  View<BlockId> free_ids;
  uint32_t* used = nullptr;

  /// @return kNoBlock when the pool is empty.  @thread any, at the same time as other `take`s
  STILLMAP_HD BlockId take() const {
    const uint32_t n = atomic_add(used, 1u);
    if (n < free_ids.size) return free_ids[n];
    atomic_add(used, ~0u);  // minus one
    return kNoBlock;
  }
  /// @thread one, while nobody takes
  STILLMAP_HD void give_back(BlockId id) const { free_ids[--*used] = id; }
};

}  // namespace stillmap
