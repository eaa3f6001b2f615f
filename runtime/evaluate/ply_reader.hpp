#pragma once

// PLY files: our own meshes and other people's point clouds.

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "kernels/base/vec.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

struct PlyMesh {
  std::vector<Vec3> vertices_m;
  std::vector<Rgb8> colours;  ///< as many as vertices, or none where the file has none
  std::vector<std::array<uint32_t, 3>> triangles;
};

/// Reads vertices `x y z` (any number type), `red green blue` (uchar) where there, and faces (polygons become
/// fans). Other elements and properties are passed over. ASCII and binary little-endian.
/// @return an error naming file and reason for a broken or cut file, an index out of range, a vertex that is
/// not
///         finite, more than 50 million vertices or triangles
Result<PlyMesh> read_ply_mesh(const std::string& path);

/// Calls `point` with each vertex in turn and keeps none: for clouds of any size. Faces are not read.
/// @param point metres; a vertex that is not finite is left out
/// @return number of vertices left out, or an error naming file and reason
Result<uint64_t> read_ply_points(const std::string& path, const std::function<void(Vec3)>& point);

}  // namespace stillmap
