#pragma once

// Which triangles a cell of eight voxels holds, for each of the 256 ways in which its corners can be inside
// (distance below 0) or outside. Computed from the topology of the cube when the program is compiled: on each
// face every run of inside corners is cut off by one segment, the segments close to loops, each loop becomes
// a fan. A face that two cells share is cut the same way by both, so the surface has no cracks.

#include <cstdint>

namespace stillmap {

/// Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2). Edge e runs along axis e / 4 from the corner
/// whose other two coordinates are the bits of e % 4, lower axis first.
constexpr int32_t kCubeEdges = 12;
constexpr int32_t kMaxCellTriangles = 5;

struct CubeEdge {
  uint8_t axis;    ///< 0 x, 1 y, 2 z
  uint8_t corner;  ///< its lower end; the other is corner | 1 << axis
};

/// The edge numbers of the triangles, three each, counter-clockwise seen from outside (distance above 0).
struct CubeCase {
  uint8_t triangles = 0;
  uint8_t edge[3 * kMaxCellTriangles] = {};
};

struct CubeCases {
  CubeEdge edges[kCubeEdges] = {};
  CubeCase cases[256] = {};  ///< by the bits of the corners that are inside
};

namespace cube_detail {

/// The edge between two neighbouring corners.
constexpr int32_t edge_between(int32_t a, int32_t b) {
  const int32_t low = a & b;
  switch (a ^ b) {
    case 1:
      return low >> 1;
    case 2:
      return 4 + ((low & 1) | (low >> 2) << 1);
    default:
      return 8 + low;
  }
}

constexpr CubeEdge edge_at(int32_t e) {
  const int32_t axis = e / 4, bits = e % 4;
  const int32_t corner = axis == 0 ? bits << 1 : axis == 1 ? (bits & 1) | (bits >> 1) << 2 : bits;
  return {static_cast<uint8_t>(axis), static_cast<uint8_t>(corner)};
}

/// Corner i (0..3) of a face, counter-clockwise seen from outside the cube. Faces 2 a and 2 a + 1 are the
/// lower and the upper one across axis a.
constexpr int32_t face_corner(int32_t face, int32_t i) {
  const int32_t axis = face / 2, side = face % 2;
  const int32_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  const int32_t k = side == 1 ? i : 3 - i;
  const int32_t on_u = k == 1 || k == 2 ? 1 : 0, on_v = k >= 2 ? 1 : 0;
  return side << axis | on_u << u | on_v << v;
}

constexpr bool on_face(int32_t edge, int32_t face) {
  const CubeEdge e = edge_at(edge);
  const int32_t axis = face / 2, side = face % 2;
  return e.axis != axis && (e.corner >> axis & 1) == side;
}

constexpr bool share_a_face(int32_t a, int32_t b) {
  for (int32_t face = 0; face < 6; ++face)
    if (on_face(a, face) && on_face(b, face)) return true;
  return false;
}

/// Edge that follows each crossed edge on its loop; -1: not crossed.
struct Loops {
  int32_t next[kCubeEdges] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
};

constexpr Loops trace(int32_t inside) {
  Loops loops;
  for (int32_t face = 0; face < 6; ++face) {
    int32_t corner[4] = {};
    for (int32_t i = 0; i < 4; ++i) corner[i] = face_corner(face, i);
    for (int32_t i = 0; i < 4; ++i) {
      if ((inside >> corner[i] & 1) || !(inside >> corner[(i + 1) % 4] & 1)) continue;
      int32_t last = (i + 1) % 4;  // of the run of inside corners that begins here
      while (inside >> corner[(last + 1) % 4] & 1) last = (last + 1) % 4;
      loops.next[edge_between(corner[i], corner[(i + 1) % 4])] =
          edge_between(corner[last], corner[(last + 1) % 4]);
    }
  }
  return loops;
}

/// A fan from `loop[apex]` has no diagonal in a face of the cube; there the neighbour could have the same
/// one, and an edge of the mesh would have four triangles.
constexpr bool is_good_apex(const int32_t* loop, int32_t size, int32_t apex) {
  for (int32_t i = 2; i < size - 1; ++i)
    if (share_a_face(loop[apex], loop[(apex + i) % size])) return false;
  return true;
}

constexpr void append_fan(const int32_t* loop, int32_t size, CubeCase& out) {
  int32_t apex = 0;
  while (!is_good_apex(loop, size, apex)) ++apex;  // every loop has one; else this does not compile
  for (int32_t i = 1; i < size - 1; ++i) {
    const int32_t at = 3 * out.triangles++;
    out.edge[at] = static_cast<uint8_t>(loop[apex]);
    out.edge[at + 1] = static_cast<uint8_t>(loop[(apex + i) % size]);
    out.edge[at + 2] = static_cast<uint8_t>(loop[(apex + i + 1) % size]);
  }
}

constexpr CubeCase make_case(int32_t inside) {
  Loops loops = trace(inside);
  CubeCase out;
  for (int32_t start = 0; start < kCubeEdges; ++start) {
    int32_t loop[kCubeEdges] = {};
    int32_t size = 0;
    for (int32_t e = start; loops.next[e] >= 0;) {
      loop[size++] = e;
      const int32_t next = loops.next[e];
      loops.next[e] = -1;
      e = next;
    }
    if (size > 0) append_fan(loop, size, out);
  }
  return out;
}

constexpr CubeCases make_cases() {
  CubeCases all;
  for (int32_t e = 0; e < kCubeEdges; ++e) all.edges[e] = edge_at(e);
  for (int32_t inside = 0; inside < 256; ++inside) all.cases[inside] = make_case(inside);
  return all;
}

}  // namespace cube_detail

/// The table.                                                             test: cube_cases_test
inline constexpr CubeCases kCubeCases = cube_detail::make_cases();

}  // namespace stillmap
