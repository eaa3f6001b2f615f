#pragma once

#include <cstdint>
#include <vector>

#include "kernels/engine.hpp"

namespace stillmap {

/// Keeps a mesh as it is sent.
class MeshRecorder : public MeshSink {
 public:
  bool begin(uint64_t vertices, uint64_t triangles) override {
    ++begins;
    announced_vertices = vertices;
    announced_triangles = triangles;
    return accept();
  }
  bool vertices(View<const Vec3> positions_m, View<const Rgb8> vertex_colours) override {
    positions.insert(positions.end(), positions_m.begin(), positions_m.end());
    colours.insert(colours.end(), vertex_colours.begin(), vertex_colours.end());
    vertices_after_triangles |= !indices.empty();
    return accept();
  }
  bool triangles(View<const uint32_t> triangle_indices) override {
    indices.insert(indices.end(), triangle_indices.begin(), triangle_indices.end());
    return accept();
  }

  uint64_t triangle_count() const { return indices.size() / 3; }

  int refuse_at_call = 0;  ///< 1: the first call is answered false, and so on; 0: none
  int calls = 0;
  int begins = 0;
  uint64_t announced_vertices = 0, announced_triangles = 0;
  bool vertices_after_triangles = false;
  std::vector<Vec3> positions;
  std::vector<Rgb8> colours;
  std::vector<uint32_t> indices;

 private:
  bool accept() { return ++calls != refuse_at_call; }
};

}  // namespace stillmap
