#pragma once

// Connected regions on the GPU, and what the mask needs besides element functions.

#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/backend/cuda/grid.hpp"
#include "kernels/mask/carry_mask.hpp"
#include "kernels/mask/cells.hpp"
#include "kernels/mask/residual_mask.hpp"

namespace stillmap {

/// Raises a byte to `value` where that is more.
STILLMAP_HD void atomic_most_byte(uint8_t* at, uint8_t value) {
  const auto address = reinterpret_cast<uintptr_t>(at);
  auto* const word = reinterpret_cast<uint32_t*>(address & ~uintptr_t{3});
  const uint32_t shift = 8 * static_cast<uint32_t>(address & 3);  // little-endian
  uint32_t was = atomic_load(word);
  while (value > (was >> shift & 0xffu)) {
    const uint32_t now = (was & ~(0xffu << shift)) | static_cast<uint32_t>(value) << shift;
    const uint32_t found = atomic_compare_exchange(word, was, now);
    if (found == was) return;
    was = found;
  }
}

/// The mask of the last frame into this one.
struct CarryMaskKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  const CarryMaskPass* pass;
  int32_t rows, cols;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const CarryMaskPass p = *pass;
    for_all(block, static_cast<uint32_t>(rows * cols), [&](uint32_t i) {
      p(static_cast<int32_t>(i) / cols, static_cast<int32_t>(i) % cols,
        [&](int32_t r, int32_t c, uint8_t dynamic) { atomic_most_byte(&p.now.expected.at(r, c), dynamic); });
    });
  }
};

/// Keeps what the next frame asks of this one's cells.
struct RememberCellsKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  CellGrid now;
  CellsBefore before;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, static_cast<uint32_t>(now.depth_m.pixels()), [&](uint32_t i) {
      before.depth_m.data[i] = now.depth_m.data[i];
      before.luma.data[i] = now.luma.data[i];
      before.crept_m.data[i] = now.crept_m.data[i];
      before.still.data[i] = now.still.data[i];
      before.dynamic.data[i] = now.dynamic.data[i]                    ? now.dynamic.data[i]
                               : now.evidence.data[i] >= kContradicts ? kDoubted
                                                                      : uint8_t{0};
    });
  }
};

// Algorithm 1 of the paper grows the mask along steps p to n with |D(p) - D(n)| < theta D(p). Which way a
// step goes matters where the difference lies between theta times the one and theta times the other depth. So
// pixels that lead to each other both ways are made one component (whose number is its lowest pixel), the few
// steps that lead one way only are listed, and what is reached is carried along them until nothing changes.
// The result is what a flood fill finds, whatever the order.

struct OneWayStep {
  int32_t from, to;  ///< pixels
};

struct ComponentMemory {
  View<int32_t> parent;   ///< by pixel: one with a lower index in the same component, or itself
  View<uint8_t> reached;  ///< by lowest pixel of a component
  View<OneWayStep> steps;

  void carve(Arena& arena, int32_t rows, int32_t cols) {
    const uint64_t pixels = static_cast<uint64_t>(rows) * static_cast<uint64_t>(cols);
    parent = arena.take<int32_t>("device: mask", pixels);
    reached = arena.take<uint8_t>("device: mask", pixels);
    steps = arena.take<OneWayStep>("device: mask", 2 * pixels);  // at most: right and down of every pixel
  }
};

namespace component_detail {

STILLMAP_HD int32_t root_of(const View<int32_t>& parent, int32_t i) {
  int32_t up = atomic_load(&parent[static_cast<uint32_t>(i)]);
  while (up != i) {
    i = up;
    up = atomic_load(&parent[static_cast<uint32_t>(i)]);
  }
  return i;
}
/// Makes one component of two; the lower root stays.
STILLMAP_HD void unite(const View<int32_t>& parent, int32_t a, int32_t b) {
  a = root_of(parent, a);
  b = root_of(parent, b);
  while (a != b) {
    const int32_t low = a < b ? a : b, high = a < b ? b : a;
    const int32_t was = atomic_compare_exchange(&parent[static_cast<uint32_t>(high)], high, low);
    if (was == high) return;
    a = root_of(parent, low);  // `high` is a root no longer
    b = root_of(parent, was);
  }
}
/// Whether the fill steps from a depth to its neighbour's.
STILLMAP_HD bool leads(float from_m, float to_m, float theta) {
  return from_m > 0.0f && to_m > 0.0f && fabsf(from_m - to_m) < theta * from_m;
}

}  // namespace component_detail

/// Every pixel for itself, nothing reached.
struct StartComponentsKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  ComponentMemory memory;
  uint32_t* step_count;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, memory.parent.size, [&](uint32_t i) {
      memory.parent[i] = static_cast<int32_t>(i);
      memory.reached[i] = 0;
      if (i == 0) *step_count = 0;
    });
  }
};

/// Unites neighbours that lead to each other, and lists steps that lead one way.
struct UniteKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  ComponentMemory memory;
  ImageView<const float> depth_m;
  float theta;
  uint32_t* step_count;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, static_cast<uint32_t>(depth_m.pixels()), [&](uint32_t i) {
      const auto at = static_cast<int32_t>(i);
      if (at % depth_m.cols + 1 < depth_m.cols) join(at, at + 1);
      if (at / depth_m.cols + 1 < depth_m.rows) join(at, at + depth_m.cols);
    });
  }

 private:
  STILLMAP_GRID void join(int32_t a, int32_t b) const {
    const float za = depth_m.data[a], zb = depth_m.data[b];
    const bool there = component_detail::leads(za, zb, theta), back = component_detail::leads(zb, za, theta);
    if (there && back)
      component_detail::unite(memory.parent, a, b);
    else if (there || back)
      memory.steps[atomic_add(step_count, 1u)] = there ? OneWayStep{a, b} : OneWayStep{b, a};
  }
};

/// Components with a pixel of the mask are reached; every pixel gets to know its component.
struct SeedKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  ComponentMemory memory;
  ImageView<const uint8_t> mask;
  ImageView<const float> depth_m;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, memory.parent.size, [&](uint32_t i) {
      const int32_t root = component_detail::root_of(memory.parent, static_cast<int32_t>(i));
      memory.parent[i] = root;  // a shorter way to the same root: others may go either way
      if (mask.data[i] && depth_m.data[i] > 0.0f) memory.reached[static_cast<uint32_t>(root)] = 1;
    });
  }
};

/// Along the steps that lead one way until nothing changes: at most once for each of them. One block.
struct FollowStepsKernel {
  static constexpr uint32_t kLanes = 256;
  struct Shared {
    uint32_t changes[kLanes / kWarp];
  };
  ComponentMemory memory;
  const uint32_t* step_count;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const uint32_t steps = *step_count;
    for (uint32_t round = 0; round < steps; ++round) {
      PerLane<Block, uint32_t> changed;
      block.each([&](uint32_t lane) {
        changed[lane] = 0;
        for (uint32_t i = lane; i < steps; i += kLanes) {
          const auto from = static_cast<uint32_t>(memory.parent[static_cast<uint32_t>(memory.steps[i].from)]),
                     to = static_cast<uint32_t>(memory.parent[static_cast<uint32_t>(memory.steps[i].to)]);
          if (!memory.reached[from] || memory.reached[to]) continue;
          memory.reached[to] = 1;
          changed[lane] = 1;
        }
      });
      if (sum_over_block(block, changed, block.shared().changes) == 0) return;
    }
  }
};

/// What was reached is masked.
struct GrowMaskKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  ComponentMemory memory;
  ImageView<uint8_t> mask;
  ImageView<const float> depth_m;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, memory.parent.size, [&](uint32_t i) {
      if (depth_m.data[i] > 0.0f && memory.reached[static_cast<uint32_t>(memory.parent[i])])
        mask.data[i] = kMasked;
    });
  }
};

}  // namespace stillmap
