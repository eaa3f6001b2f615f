#include "kernels/extract/surface_cells.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/analytic_map.hpp"

namespace stillmap {
namespace {

/// The rules, voxel by voxel.
struct PlainRules {
  AnalyticMap& map;

  int16_t sdf(Int3 voxel) const {
    const VolumeView view = map.view();
    const BlockId id = view.voxels_of(block_of_voxel(voxel));
    return id == kNoBlock ? kSdfUnobserved : view.blocks[id].surface[index_in_block(voxel)].sdf;
  }
  static Int3 corner(Int3 cell, int c) { return cell + Int3{c & 1, c >> 1 & 1, c >> 2}; }
  bool crossed(Int3 a, Int3 b) const { return (sdf(a) < 0) != (sdf(b) < 0); }

  bool active(Int3 cell) const {
    bool any = false;
    for (int c = 0; c < 8; ++c) {
      if (sdf(corner(cell, c)) == kSdfUnobserved) return false;
      for (int axis = 0; axis < 3; ++axis) {
        const Int3 a = corner(cell, c), b = corner(cell, c | 1 << axis);
        if (c >> axis & 1 || !crossed(a, b)) continue;
        if (is_far(sdf(a)) || is_far(sdf(b))) return false;
        any = true;
      }
    }
    return any;
  }
  bool used(Int3 voxel, int axis) const {
    const Int3 unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    if (!crossed(voxel, voxel + unit[axis])) return false;
    const Int3 u = unit[(axis + 1) % 3], v = unit[(axis + 2) % 3];
    const auto less = [](Int3 a, Int3 b) { return Int3{a.x - b.x, a.y - b.y, a.z - b.z}; };
    return active(voxel) || active(less(voxel, u)) || active(less(voxel, v)) ||
           active(less(less(voxel, u), v));
  }
};

void compare_with_rules(AnalyticMap& map, Int3 block) {
  VoxelRows rows;
  CellRows cells;
  SurfaceEdges edges;
  EdgeRanks ranks;
  read_rows(map.view(), block, rows);
  find_cells(rows, cells);
  find_edges(rows, cells, edges);
  const uint32_t count = rank_edges(edges, ranks);
  const PlainRules plain{map};
  uint32_t rank = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (int z = 0; z < 8; ++z) {
      ASSERT_EQ(ranks.before[axis][z], rank);
      for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x) {
          const bool used = edges.used[axis][z] >> (x + 8 * y) & 1;
          ASSERT_EQ(used, plain.used(first_voxel(block) + Int3{x, y, z}, axis)) << axis << x << y << z;
          rank += used;
        }
    }
  EXPECT_EQ(count, rank);
  for (int z = -1; z < 8; ++z)
    for (int y = -1; y < 8; ++y)
      for (int x = -1; x < 8; ++x)
        ASSERT_EQ(cells.active[z + 1][y + 1] >> (x + 1) & 1,
                  plain.active(first_voxel(block) + Int3{x, y, z}));
}

TEST(SurfaceCells, FollowTheRulesOnRandomVoxels) {
  std::mt19937 random(7);
  for (int round = 0; round < 6; ++round) {
    AnalyticMap map(27);
    const Int3 centre = {-1, 0, 3};
    // From nearly everything observed and near to many holes and many far voxels.
    std::uniform_int_distribution<int> percent(0, 99), near(-kFarSdf + 1, kFarSdf - 1);
    for (int dz = -1; dz <= 1; ++dz)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          if (round > 3 && percent(random) < 20) continue;  // absent block
          for (int i = 0; i < kBlockVoxels; ++i) {
            const int what = percent(random);
            if (what < round) continue;  // unobserved
            map.observe(centre + Int3{dx, dy, dz}, i,
                        what < 3 * round   ? kSdfMax
                        : what < 4 * round ? static_cast<int16_t>(-kSdfMax)
                                           : static_cast<int16_t>(near(random)));
          }
        }
    compare_with_rules(map, centre);
  }
}

TEST(SurfaceCells, FreeBesideUnseenInsideIsNoSurface) {
  // The rim of an object: free space at full distance next to voxels just behind the seen surface.
  AnalyticMap map(27);
  map.fill({0, 0, 0}, {1, 1, 1}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = p.x < 0.055 ? 0.1 : -0.02;
    return s;
  });
  VoxelRows rows;
  CellRows cells;
  read_rows(map.view(), {0, 0, 0}, rows);
  find_cells(rows, cells);
  for (const auto& plane : cells.active)
    for (const uint16_t row : plane) EXPECT_EQ(row, 0);
}

TEST(SurfaceCells, VoxelsSeenTooSeldomDoNotCount) {
  AnalyticMap map(8);
  map.fill({0, 0, 0}, {1, 1, 1}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = p.x - 0.043;
    return s;
  });
  for (VoxelRecord& r : map.block({0, 0, 0})->record) r.weight = 3;
  VolumeView view = map.view();
  const auto active_cells = [&] {
    VoxelRows rows;
    CellRows cells;
    read_rows(view, {0, 0, 0}, rows);
    find_cells(rows, cells);
    uint32_t count = 0;
    for (const auto& plane : cells.active)
      for (const uint16_t row : plane) count += count_bits(row);
    return count;
  };
  view.mesh_min_weight = 3;
  EXPECT_EQ(active_cells(), 49u);  // 7x7 cells lie across the plane, all corners in this block
  view.mesh_min_weight = 4;
  EXPECT_EQ(active_cells(), 0u);

  view.mesh_min_weight = 3;
  view.mesh_min_surface = 2;  // the voxels were free when they were seen
  EXPECT_EQ(active_cells(), 0u);
  for (VoxelRecord& r : map.block({0, 0, 0})->record) r.colour_weight = 2;
  EXPECT_EQ(active_cells(), 49u);
}

TEST(CountBits, Counts) {
  EXPECT_EQ(count_bits(0), 0u);
  EXPECT_EQ(count_bits(~0ull), 64u);
  EXPECT_EQ(count_bits(0x8000000000000001ull), 2u);
  EXPECT_EQ(count_bits(0x0123456789abcdefull), 32u);
}

}  // namespace
}  // namespace stillmap
