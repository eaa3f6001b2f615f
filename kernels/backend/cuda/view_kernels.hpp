#pragma once

// Views and the mesh of the map on the GPU. None of it is part of a frame.

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/extract/extract_pass.hpp"
#include "kernels/raycast/raycast_pass.hpp"

namespace stillmap {

/// No surface in any tile of a view.
struct EmptyRangesKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  RayRanges ranges;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, static_cast<uint32_t>(ranges.tiles.pixels()),
            [&](uint32_t i) { ranges.tiles.data[i] = RayRange{}; });
  }
};

/// pass(id) for every id of the pool of voxel blocks.
template <class Pass>
struct PoolKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  Pass pass;
  uint32_t blocks;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, blocks, [&](uint32_t id) { pass(id); });
  }
};

struct CastKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  RaycastPass pass;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const int32_t cols = pass.depth_m.cols;
    for_all(block, static_cast<uint32_t>(pass.depth_m.pixels()), [&](uint32_t i) {
      BlockCache cache;
      pass(static_cast<int32_t>(i) / cols, static_cast<int32_t>(i) % cols, cache);
    });
  }
};

/// What a block can add to a surface; see ExtractPass.
struct ClassifyPass {
  ExtractPass pass;
  View<uint8_t> classes;

  STILLMAP_HD void operator()(BlockId id) const {
    classes[id] = pass.map.block_keys[id] == kEmptyKey ? uint8_t{0} : pass.classify(id);
  }
};
/// Keys of the blocks that may hold a surface; kEmptyKey for the others.
struct CandidateKeysPass {
  ExtractPass pass;
  View<const uint8_t> classes;
  View<BlockKey> keys;

  STILLMAP_HD void operator()(BlockId id) const {
    const BlockKey key = pass.map.block_keys[id];
    keys[id] = key != kEmptyKey && pass.may_hold_surface(id, classes.data) ? key : kEmptyKey;
  }
};

/// Of the blocks in order: how many vertices and triangles.
struct CountSurfaceKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  ExtractPass pass;
  View<const BlockId> order;
  View<BlockCounts> counts;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, order.size, [&](uint32_t rank) { counts[rank] = pass.count(order[rank]); });
  }
};

/// Vertices of the blocks in [begin, end) of the order.
struct WriteVerticesKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  ExtractPass pass;
  View<const BlockId> order;
  View<const uint32_t> first_vertex;  ///< by block id
  uint32_t begin, end, vertices_before;
  View<Vec3> positions_m;
  View<Rgb8> colours;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, end - begin, [&](uint32_t i) {
      const BlockId id = order[begin + i];
      const uint32_t at = first_vertex[id] - vertices_before;
      pass.write_vertices(id, positions_m.data + at, colours.data + at);
    });
  }
};
/// Triangles of the blocks in [begin, end) of the order.
struct WriteTrianglesKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  ExtractPass pass;
  View<const BlockId> order;
  View<const uint32_t> first_vertex;    ///< by block id
  View<const uint32_t> first_triangle;  ///< by rank
  uint32_t begin, end;
  View<uint32_t> indices;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, end - begin, [&](uint32_t i) {
      const uint32_t at = 3 * (first_triangle[begin + i] - first_triangle[begin]);
      pass.write_triangles(order[begin + i], first_vertex.data, indices.data + at);
    });
  }
};

}  // namespace stillmap
