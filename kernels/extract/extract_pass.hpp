#pragma once

// The zero level of the map as triangles (marching cubes), one block at a time. Every voxel owns its edges to
// +x, +y and +z, and a vertex belongs to the block that owns its edge; so vertices are shared within and
// across blocks, and a block can be worked on alone.

#include <cstdint>

#include "kernels/extract/cube_cases.hpp"
#include "kernels/extract/edge_vertex.hpp"
#include "kernels/extract/surface_cells.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

struct BlockCounts {
  uint32_t vertices = 0;   ///< at most 3 kBlockVoxels
  uint32_t triangles = 0;  ///< at most kMaxCellTriangles kBlockVoxels
};

/// What a block can add to a surface.
constexpr uint8_t kHasInside = 1;   ///< a voxel below 0 that is not far
constexpr uint8_t kHasOutside = 2;  ///< a voxel of 0 or above that is not far

struct ExtractPass {
  VolumeView map;
  const CubeCases* cases = nullptr;

  /// @return kHasInside | kHasOutside as they apply
  STILLMAP_HD uint8_t classify(BlockId id) const {
    if (map.settled_free.size > id && map.settled_free[id]) return 0;
    const VoxelSurface* v = map.blocks[id].surface;
    uint32_t inside = 0, outside = 0;
    for (int32_t i = 0; i < kBlockVoxels; ++i) {
      const int32_t sdf = v[i].sdf;
      inside |= static_cast<uint32_t>(sdf < 0) & static_cast<uint32_t>(sdf > -kFarSdf);
      outside |= static_cast<uint32_t>(sdf >= 0) & static_cast<uint32_t>(sdf < kFarSdf);
    }
    return static_cast<uint8_t>(inside * kHasInside | outside * kHasOutside);
  }

  /// False: neither a vertex nor a triangle belongs to the block. Cheap.
  /// @param classes by block id, as `classify` answers
  STILLMAP_HD bool may_hold_surface(BlockId id, const uint8_t* classes) const {
    const Int3 block = unpack(map.block_keys[id]);
    uint32_t sides = classes[id];
    for (int32_t i = 1; i < 8 && sides != (kHasInside | kHasOutside); ++i) {
      const BlockId upper = map.voxels_of(block + Int3{i & 1, i >> 1 & 1, i >> 2});
      if (upper != kNoBlock) sides |= classes[upper];
    }
    return sides == (kHasInside | kHasOutside);
  }

  STILLMAP_HD BlockCounts count(BlockId id) const {
    VoxelRows rows;
    CellRows cells;
    SurfaceEdges edges;
    EdgeRanks ranks;
    analyse(unpack(map.block_keys[id]), rows, cells, edges);
    BlockCounts counts;
    counts.vertices = rank_edges(edges, ranks);
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y)
        for (uint32_t x = 0, bits = cells.active[z + 1][y + 1] >> 1; bits; ++x, bits >>= 1)
          if (bits & 1u)
            counts.triangles += cases->cases[cell_case(rows, static_cast<int32_t>(x), y, z)].triangles;
    return counts;
  }

  /// Writes as many vertices as `count` says.
  /// @param positions_m map frame
  STILLMAP_HD void write_vertices(BlockId id, Vec3* positions_m, Rgb8* colours) const {
    const Int3 block = unpack(map.block_keys[id]);
    VoxelRows rows;
    CellRows cells;
    SurfaceEdges edges;
    analyse(block, rows, cells, edges);
    uint32_t at = 0;
    for (int32_t axis = 0; axis < 3; ++axis) {
      const Int3 step = {axis == 0, axis == 1, axis == 2};
      const BlockId upper_id = map.voxels_of(block + step);
      const VoxelBlock* upper = upper_id == kNoBlock ? nullptr : &map.blocks[upper_id];
      for (int32_t z = 0; z < kBlockEdge; ++z) {
        int32_t i = 0;
        for (uint64_t bits = edges.used[axis][z]; bits; ++i, bits >>= 1) {
          if (!(bits & 1u)) continue;
          write_vertex(block, {i & 7, i >> 3, z}, axis, map.blocks[id], upper, positions_m[at], colours[at]);
          ++at;
        }
      }
    }
  }

  /// Writes three indices for each triangle that `count` says.
  /// @param first_vertex by block id: vertices in the blocks before
  STILLMAP_HD void write_triangles(BlockId id, const uint32_t* first_vertex, uint32_t* indices) const {
    const Int3 block = unpack(map.block_keys[id]);
    VoxelRows rows;
    CellRows cells;
    Owner owners[8];
    analyse(block, rows, cells, owners[0].edges);
    rank_edges(owners[0].edges, owners[0].ranks);
    owners[0].first_vertex = first_vertex[id];
    owners[0].known = true;
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y)
        for (int32_t x = 0; x < kBlockEdge; ++x) {
          if (!(cells.active[z + 1][y + 1] >> (x + 1) & 1)) continue;
          const CubeCase& cube = cases->cases[cell_case(rows, x, y, z)];
          for (int32_t i = 0; i < 3 * cube.triangles; ++i)
            *indices++ = vertex_of(block, {x, y, z}, cases->edges[cube.edge[i]], first_vertex, owners);
        }
  }

 private:
  /// One of the eight blocks that own the edges of this block's cells; the seven others are analysed when a
  /// triangle needs them.
  struct Owner {
    bool known = false;
    uint32_t first_vertex = 0;
    SurfaceEdges edges;
    EdgeRanks ranks;
  };

  STILLMAP_HD void analyse(Int3 block, VoxelRows& rows, CellRows& cells, SurfaceEdges& edges) const {
    read_rows(map, block, rows);
    find_cells(rows, cells);
    find_edges(rows, cells, edges);
  }

  STILLMAP_HD void write_vertex(Int3 block, Int3 local, int32_t axis, const VoxelBlock& own,
                                const VoxelBlock* upper, Vec3& position_m, Rgb8& colour) const {
    const Int3 next = local + Int3{axis == 0, axis == 1, axis == 2};
    const bool leaves = ((next.x | next.y | next.z) & kBlockEdge) != 0;
    const VoxelBlock& other = leaves ? *upper : own;
    const int32_t i0 = index_in_block(local), i1 = index_in_block(next);
    const float t = crossing(own.surface[i0].sdf, other.surface[i1].sdf);
    const Int3 voxel = first_voxel(block) + local;
    const Vec3 along = {axis == 0 ? t : 0.0f, axis == 1 ? t : 0.0f, axis == 2 ? t : 0.0f};
    position_m = voxel_position(voxel, map.voxel_m) + map.voxel_m * along;
    colour = colour_between(own.surface[i0], own.record[i0], other.surface[i1], other.record[i1], t);
  }

  STILLMAP_HD uint32_t vertex_of(Int3 block, Int3 cell, CubeEdge edge, const uint32_t* first_vertex,
                                 Owner* owners) const {
    const Int3 voxel = cell + Int3{edge.corner & 1, edge.corner >> 1 & 1, edge.corner >> 2};
    const Int3 offset = {voxel.x >> 3, voxel.y >> 3, voxel.z >> 3};
    Owner& owner = owners[offset.x | offset.y << 1 | offset.z << 2];
    if (!owner.known) {
      VoxelRows rows;
      CellRows cells;
      analyse(block + offset, rows, cells, owner.edges);
      rank_edges(owner.edges, owner.ranks);
      owner.first_vertex = first_vertex[map.voxels_of(block + offset)];
      owner.known = true;
    }
    const int32_t z = voxel.z & 7;
    const int32_t bit = (voxel.x & 7) | (voxel.y & 7) << 3;
    const uint64_t before = owner.edges.used[edge.axis][z] & ((1ull << bit) - 1);
    return owner.first_vertex + owner.ranks.before[edge.axis][z] + count_bits(before);
  }
};

}  // namespace stillmap
