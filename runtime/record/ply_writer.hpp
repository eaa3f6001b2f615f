#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/engine.hpp"
#include "runtime/record/output_file.hpp"

namespace stillmap {

/// Takes a mesh as the engine extracts it and streams it to a binary little-endian PLY: vertices `float x y
/// z` (metres, map frame) and `uchar red green blue`, triangles `list uchar int vertex_indices`. Fixed
/// memory. @thread one
class PlyWriter final : public MeshSink {
 public:
  explicit PlyWriter(std::string path);

  bool begin(uint64_t vertices, uint64_t triangles) override;
  bool vertices(View<const Vec3> positions_m, View<const Rgb8> colours) override;
  bool triangles(View<const uint32_t> indices) override;

  /// Puts the file in place when all that `begin` announced has come; else removes it.
  /// @return false when it is not there; `error()` says why
  bool close();
  const std::string& error() const { return error_; }
  uint64_t vertex_count() const { return vertices_done_; }
  uint64_t triangle_count() const { return triangles_done_; }

 private:
  bool refuse(const std::string& why);
  bool checked(bool written);

  std::string path_, error_;
  std::optional<OutputFile> file_;
  uint64_t vertices_ = 0, triangles_ = 0, vertices_done_ = 0, triangles_done_ = 0;
};

/// Writes points as a binary PLY of vertices `float x y z`. @return empty, or the error
std::string write_point_cloud(const std::string& path, const std::vector<Vec3>& points_m);

}  // namespace stillmap
