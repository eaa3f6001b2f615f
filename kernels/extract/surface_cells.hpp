#pragma once

// The cells and edges of one block that the surface crosses, as bits: a row of voxels along x is one word.

#include <cstdint>

#include "kernels/extract/surface_rule.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// A block with the voxels next to it: rows [z + 1][y + 1] for y, z in -1..8, voxel x in bit x + 1.
struct VoxelRows {
  static constexpr int32_t kEdge = kBlockEdge + 2;
  uint16_t observed[kEdge][kEdge];
  uint16_t inside[kEdge][kEdge];  ///< distance below 0
  uint16_t far[kEdge][kEdge];     ///< see is_far
};

/// Cells that hold a part of the surface: row [z + 1][y + 1], bit x + 1 for the cell between the voxels
/// (x, y, z) and (x + 1, y + 1, z + 1); x, y, z in -1..7.
struct CellRows {
  uint16_t active[kBlockEdge + 1][kBlockEdge + 1];
};

/// Edges from a voxel of the block to its neighbour along +axis that carry a vertex: [axis][z], bit
/// x + 8 y. Their order by axis, z, y, x is the order of the vertices.
struct SurfaceEdges {
  uint64_t used[3][kBlockEdge];
};

STILLMAP_HD uint32_t count_bits(uint64_t x) {
  x -= x >> 1 & 0x5555555555555555ull;
  x = (x & 0x3333333333333333ull) + (x >> 2 & 0x3333333333333333ull);
  x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0full;
  return static_cast<uint32_t>(x * 0x0101010101010101ull >> 56);
}

namespace cells_detail {

/// Adds `count` voxels of a row from voxel `first` of the block, the first of them to bit `bit`.
STILLMAP_HD void add_voxels(const VolumeView& map, const BlockAt& block, int32_t first, int32_t count,
                            int32_t bit, uint32_t& observed, uint32_t& inside, uint32_t& far) {
  for (int32_t i = first; i < first + count; ++i, ++bit) {
    const int16_t sdf = block.surface(i).sdf;
    const VoxelRecord record = block.record(i);
    const bool enough =
        record.weight >= map.mesh_min_weight && (record.colour_weight >= map.mesh_min_surface || is_far(sdf));
    observed |= static_cast<uint32_t>(enough) << bit;
    inside |= static_cast<uint32_t>(sdf < 0) << bit;
    far |= static_cast<uint32_t>(is_far(sdf)) << bit;
  }
}

/// -1: 0, 0..7: 1, 8: 2.
STILLMAP_HD int32_t neighbour_of(int32_t coordinate) {
  return (coordinate + kBlockEdge) >> 3;
}

}  // namespace cells_detail

/// Reads block `block` and the voxels around it; absent blocks, and voxels that were not seen often enough
/// (map.mesh_min_weight, map.mesh_min_surface), are unobserved.
STILLMAP_HD void read_rows(const VolumeView& map, Int3 block, VoxelRows& rows) {
  BlockAt around[27];
  for (int32_t i = 0; i < 27; ++i) around[i] = map.read(block + Int3{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1});
  for (int32_t z = -1; z <= kBlockEdge; ++z)
    for (int32_t y = -1; y <= kBlockEdge; ++y) {
      const BlockAt* row = around + 3 * cells_detail::neighbour_of(y) + 9 * cells_detail::neighbour_of(z);
      const int32_t first = voxel_index(0, y & 7, z & 7);
      uint32_t observed = 0, inside = 0, far = 0;
      if (row[0]) cells_detail::add_voxels(map, row[0], first + 7, 1, 0, observed, inside, far);
      if (row[1]) cells_detail::add_voxels(map, row[1], first, 8, 1, observed, inside, far);
      if (row[2]) cells_detail::add_voxels(map, row[2], first, 1, 9, observed, inside, far);
      rows.observed[z + 1][y + 1] = static_cast<uint16_t>(observed);
      rows.inside[z + 1][y + 1] = static_cast<uint16_t>(inside);
      rows.far[z + 1][y + 1] = static_cast<uint16_t>(far);
    }
}

/// Cells with corners on both sides of the surface, all eight observed, and no crossed edge with an end that
/// is_far.                                                                test: surface_cells_test
STILLMAP_HD void find_cells(const VoxelRows& rows, CellRows& cells) {
  for (int32_t z = 0; z <= kBlockEdge; ++z)
    for (int32_t y = 0; y <= kBlockEdge; ++y) {
      uint32_t observed = ~0u, all_inside = ~0u, any_inside = 0, rim = 0;
      for (int32_t i = 0; i < 4; ++i) {
        const int32_t yi = y + (i & 1), zi = z + (i >> 1);
        const uint32_t in = rows.inside[zi][yi], far = rows.far[zi][yi];
        observed &= rows.observed[zi][yi];
        all_inside &= in;
        any_inside |= in;
        rim |= (in ^ in >> 1) & (far | far >> 1);  // edges along x
      }
      for (int32_t i = 0; i < 2; ++i) {  // edges along y, then along z
        const uint32_t along_y = (rows.inside[z + i][y] ^ rows.inside[z + i][y + 1]) &
                                 (rows.far[z + i][y] | rows.far[z + i][y + 1]);
        const uint32_t along_z = (rows.inside[z][y + i] ^ rows.inside[z + 1][y + i]) &
                                 (rows.far[z][y + i] | rows.far[z + 1][y + i]);
        rim |= along_y | along_y >> 1 | along_z | along_z >> 1;
      }
      const uint32_t crossed = (any_inside | any_inside >> 1) & ~(all_inside & all_inside >> 1);
      cells.active[z][y] = static_cast<uint16_t>(observed & observed >> 1 & crossed & ~rim & 0x1ffu);
    }
}

/// The edges that at least one cell around them uses; the other crossed edges carry no vertex.
///                                                                        test: surface_cells_test
STILLMAP_HD void find_edges(const VoxelRows& rows, const CellRows& cells, SurfaceEdges& edges) {
  for (int32_t z = 0; z < kBlockEdge; ++z) {
    uint64_t x_word = 0, y_word = 0, z_word = 0;
    for (int32_t y = 0; y < kBlockEdge; ++y) {
      const uint32_t in = rows.inside[z + 1][y + 1];
      const uint32_t here = cells.active[z + 1][y + 1], below_y = cells.active[z + 1][y],
                     below_z = cells.active[z][y + 1], below_yz = cells.active[z][y];
      const uint32_t beside_y = here | below_z, beside_z = here | below_y;
      const uint32_t along_x = (in ^ in >> 1) & (beside_y | below_y | below_yz);
      const uint32_t along_y = (in ^ rows.inside[z + 1][y + 2]) & (beside_y | beside_y << 1);
      const uint32_t along_z = (in ^ rows.inside[z + 2][y + 1]) & (beside_z | beside_z << 1);
      x_word |= static_cast<uint64_t>(along_x >> 1 & 0xffu) << 8 * y;
      y_word |= static_cast<uint64_t>(along_y >> 1 & 0xffu) << 8 * y;
      z_word |= static_cast<uint64_t>(along_z >> 1 & 0xffu) << 8 * y;
    }
    edges.used[0][z] = x_word;
    edges.used[1][z] = y_word;
    edges.used[2][z] = z_word;
  }
}

/// Corners of the cell at (x, y, z), 0..7 each, that are inside; index of its case.
STILLMAP_HD uint32_t cell_case(const VoxelRows& rows, int32_t x, int32_t y, int32_t z) {
  const auto pair = [&](int32_t yi, int32_t zi) {
    return static_cast<uint32_t>(rows.inside[zi + 1][yi + 1]) >> (x + 1) & 3u;
  };
  return pair(y, z) | pair(y + 1, z) << 2 | pair(y, z + 1) << 4 | pair(y + 1, z + 1) << 6;
}

/// The number of an edge among the used ones of its block.
struct EdgeRanks {
  uint16_t before[3][kBlockEdge];  ///< used edges in the words before
};

/// @return how many edges are used
STILLMAP_HD uint32_t rank_edges(const SurfaceEdges& edges, EdgeRanks& ranks) {
  uint32_t sum = 0;
  for (int32_t axis = 0; axis < 3; ++axis)
    for (int32_t z = 0; z < kBlockEdge; ++z) {
      ranks.before[axis][z] = static_cast<uint16_t>(sum);
      sum += count_bits(edges.used[axis][z]);
    }
  return sum;
}

}  // namespace stillmap
