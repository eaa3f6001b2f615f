#include "kernels/extract/cube_cases.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "kernels/base/vec.hpp"

namespace stillmap {
namespace {

using Directed = std::pair<int, int>;

bool inside(int cube, int corner) {
  return cube >> corner & 1;
}
int upper_corner(CubeEdge e) {
  return e.corner | 1 << e.axis;
}
Vec3d corner_position(int corner) {
  return {double(corner & 1), double(corner >> 1 & 1), double(corner >> 2)};
}
Vec3d edge_middle(int edge) {
  const CubeEdge e = kCubeCases.edges[edge];
  return 0.5 * (corner_position(e.corner) + corner_position(upper_corner(e)));
}
bool lies_on(int edge, int axis, int side) {
  const Vec3d m = edge_middle(edge);
  return (axis == 0 ? m.x : axis == 1 ? m.y : m.z) == side;
}

/// Directed edges of the triangles of a case that no other triangle of it has the other way round.
std::multiset<Directed> boundary(const CubeCase& cube) {
  std::multiset<Directed> edges;
  for (int t = 0; t < cube.triangles; ++t)
    for (int i = 0; i < 3; ++i) {
      const Directed d{cube.edge[3 * t + i], cube.edge[3 * t + (i + 1) % 3]};
      const auto twin = edges.find({d.second, d.first});
      if (twin != edges.end())
        edges.erase(twin);
      else
        edges.insert(d);
    }
  return edges;
}

TEST(CubeCases, EveryEdgeJoinsTwoNeighbouringCornersOnce) {
  std::set<std::pair<int, int>> seen;
  for (const CubeEdge e : kCubeCases.edges) {
    ASSERT_LT(e.axis, 3);
    EXPECT_EQ(e.corner >> e.axis & 1, 0);
    seen.insert({e.corner, upper_corner(e)});
  }
  EXPECT_EQ(seen.size(), 12u);
}

TEST(CubeCases, TrianglesUseExactlyTheEdgesWithASignChange) {
  for (int c = 0; c < 256; ++c) {
    std::set<int> used, crossed;
    const CubeCase& cube = kCubeCases.cases[c];
    ASSERT_LE(cube.triangles, kMaxCellTriangles);
    for (int i = 0; i < 3 * cube.triangles; ++i) used.insert(cube.edge[i]);
    for (int e = 0; e < 12; ++e) {
      const CubeEdge edge = kCubeCases.edges[e];
      if (inside(c, edge.corner) != inside(c, upper_corner(edge))) crossed.insert(e);
    }
    EXPECT_EQ(used, crossed) << "case " << c;
    for (int t = 0; t < cube.triangles; ++t) {
      const std::set<int> corners(cube.edge + 3 * t, cube.edge + 3 * t + 3);
      EXPECT_EQ(corners.size(), 3u) << "case " << c;
    }
  }
}

TEST(CubeCases, OpenOnlyOnFacesAndNoDiagonalLiesInOne) {
  for (int c = 0; c < 256; ++c) {
    const CubeCase& cube = kCubeCases.cases[c];
    const std::multiset<Directed> open = boundary(cube);
    for (const Directed& d : open) EXPECT_TRUE(cube_detail::share_a_face(d.first, d.second)) << "case " << c;
    for (int t = 0; t < cube.triangles; ++t)
      for (int i = 0; i < 3; ++i) {
        const Directed d{cube.edge[3 * t + i], cube.edge[3 * t + (i + 1) % 3]};
        EXPECT_TRUE(open.count(d) || !cube_detail::share_a_face(d.first, d.second)) << "case " << c;
      }
  }
}

/// Segments on one face, with edges named by (axis, the two other coordinates on the face) so that both cells
/// of the face use the same names.
std::multiset<std::pair<std::vector<double>, std::vector<double>>> segments_on(int cube, int axis, int side,
                                                                               bool reversed) {
  std::multiset<std::pair<std::vector<double>, std::vector<double>>> out;
  const auto on_face = [&](int edge) {
    const Vec3d m = edge_middle(edge);
    std::vector<double> p = {m.x, m.y, m.z};
    p.erase(p.begin() + axis);
    return p;
  };
  for (const auto& [a, b] : boundary(kCubeCases.cases[cube]))
    if (lies_on(a, axis, side) && lies_on(b, axis, side))
      out.insert(reversed ? std::make_pair(on_face(b), on_face(a)) : std::make_pair(on_face(a), on_face(b)));
  return out;
}

TEST(CubeCases, NeighbouringCellsCutTheirCommonFaceAlikeInOppositeDirections) {
  // Every case against every case whose lower face has the corners of the first one's upper face.
  for (int axis = 0; axis < 3; ++axis)
    for (int lower = 0; lower < 256; ++lower) {
      const auto expected = segments_on(lower, axis, 1, true);
      for (int upper = 0; upper < 256; ++upper) {
        bool fits = true;
        for (int corner = 0; corner < 8; ++corner)
          if (!(corner >> axis & 1)) fits &= inside(upper, corner) == inside(lower, corner | 1 << axis);
        if (!fits) continue;
        ASSERT_EQ(segments_on(upper, axis, 0, false), expected) << lower << " below " << upper;
      }
    }
}

TEST(CubeCases, EverySegmentOfAFaceHasTheInsideOnItsRightSeenFromOutside) {
  // With the normal of the face towards us the surface that goes on into the cell is then counter-clockwise
  // seen from the outside of the body.
  for (int c = 0; c < 256; ++c)
    for (const auto& [a, b] : boundary(kCubeCases.cases[c]))
      for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
          if (!lies_on(a, axis, side) || !lies_on(b, axis, side)) continue;
          Vec3d normal;
          (axis == 0 ? normal.x : axis == 1 ? normal.y : normal.z) = side ? 1 : -1;
          const Vec3d pa = edge_middle(a), left = cross(normal, edge_middle(b) - pa);
          const CubeEdge e = kCubeCases.edges[a];
          for (const int corner : {int{e.corner}, upper_corner(e)}) {
            const double on_left = dot(left, corner_position(corner) - pa);
            EXPECT_EQ(on_left < 0, inside(c, corner)) << "case " << c;
          }
        }
}

TEST(CubeCases, ASingleCornerGivesATriangleThatLooksAwayFromIt) {
  for (int corner = 0; corner < 8; ++corner)
    for (const bool whole_but_one : {false, true}) {
      const int c = whole_but_one ? 255 ^ 1 << corner : 1 << corner;
      const CubeCase& cube = kCubeCases.cases[c];
      ASSERT_EQ(cube.triangles, 1);
      const Vec3d p0 = edge_middle(cube.edge[0]);
      const Vec3d normal = cross(edge_middle(cube.edge[1]) - p0, edge_middle(cube.edge[2]) - p0);
      EXPECT_EQ(dot(normal, p0 - corner_position(corner)) > 0, !whole_but_one) << corner;
    }
  EXPECT_EQ(kCubeCases.cases[0].triangles, 0);
  EXPECT_EQ(kCubeCases.cases[255].triangles, 0);
}

}  // namespace
}  // namespace stillmap
