#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/mask/parts.hpp"

namespace stillmap {

inline constexpr int32_t kRows = 60, kCols = 80;
inline constexpr float kWallM = 3.0f, kNearM = 1.5f;

/// A rectangle of cells, ends excluded.
struct Patch {
  int32_t row0, row1, col0, col1;

  bool holds(int32_t r, int32_t c) const { return r >= row0 && r < row1 && c >= col0 && c < col1; }
};

/// A grid that looks at a wall, all of which agrees with the map.
class PartsTest : public testing::Test {
 protected:
  PartsTest() {
    cells.px = 1;
    cells.k = {80, 80, 40, 30, kCols, kRows};
    noise = depth_noise({}, cells.k);
    cells.depth_m = image(depth, kWallM);
    cells.luma = image(luma, 20000.0f);
    cells.normal = image(normal, Vec3{0, 0, -1});
    cells.evidence = image(evidence, 0.0f);
    cells.residual = image(residual, CellResidual{});
    cells.crept_m = image(crept, 0.0f);
    cells.still = image(still, uint16_t{0});
    cells.settled_frames = 30;
    cells.fused = image(fused, uint8_t{0});
    cells.expected = image(expected, uint8_t{0});
    cells.dynamic = image(dynamic, uint8_t{0});
    cells.part = image(part, int32_t{-1});
    before = {image(depth_before, kWallM), image(luma_before, 20000.0f), image(crept_before, 0.0f),
              image(dynamic_before, uint8_t{0}), image(still_before, uint16_t{9})};
    memory.border = image(border, uint8_t{0});
    memory.scratch = image(scratch, uint8_t{0});
    parts.resize(kRows * kCols);
    queue.resize(kRows * kCols);
    memory.parts = {parts.data(), kRows * kCols};
    memory.queue = {queue.data(), kRows * kCols};
  }

  template <class T>
  ImageView<T> image(std::vector<T>& data, T value) {
    data.assign(kRows * kCols, value);
    return {data.data(), kRows, kCols, kCols};
  }
  template <class F>
  void in(const Patch& patch, const F& f) {
    for (int32_t r = patch.row0; r < patch.row1; ++r)
      for (int32_t c = patch.col0; c < patch.col1; ++c) f(r, c);
  }
  void put(const Patch& patch, float depth_m, Contradiction contradiction) {
    in(patch, [&](int32_t r, int32_t c) {
      cells.depth_m.at(r, c) = depth_m;
      cells.evidence.at(r, c) = contradiction;
    });
  }
  void find_normals() {
    const CellNormalPass pass{cells};
    in({0, kRows, 0, kCols}, pass);
  }
  int32_t find_parts() {
    find_bends(cells, memory, params, 0, kRows);
    return segment(cells, memory, noise);
  }
  /// As if the last frame had it so.
  void expect(const Patch& patch, uint8_t what) {
    in(patch, [&](int32_t r, int32_t c) { cells.expected.at(r, c) = what; });
  }
  int32_t decide() {
    const int32_t count = find_parts();
    gather_parts(cells, count, memory, noise);
    agree_on_motion(count, memory, params, usual);
    decide_parts(cells, count, memory, params, usual);
    return count;
  }
  int32_t dynamic_cells(const Patch& where = {0, kRows, 0, kCols}) {
    int32_t n = 0;
    in(where, [&](int32_t r, int32_t c) { n += is_dynamic(cells.dynamic.at(r, c)); });
    return n;
  }
  /// The surface of the patch lies `off` from where the map has it, with normals that show all directions.
  void shift(const Patch& patch, Vec3 off_m) {
    in(patch, [&](int32_t r, int32_t c) {
      const float u = 0.5f * std::sin(0.9f * static_cast<float>(r)),
                  v = 0.5f * std::cos(0.7f * static_cast<float>(c));
      const Vec3 n = normalized(Vec3{u, v, -1});
      CellResidual& cell = cells.residual.at(r, c);
      cell.terms = {};
      cell.terms.depth_gradient = n;
      cell.terms.depth_residual_m = dot(n, off_m);
      cell.terms.depth_weight = 1;
      cell.arm = cells.point(r, c);
    });
  }

  CellGrid cells;
  CellsBefore before;
  PartMemory memory;
  MaskParams params;
  DepthNoise noise;
  float usual = 1.0f;

 private:
  std::vector<float> depth, luma, evidence, crept, depth_before, luma_before, crept_before;
  std::vector<Vec3> normal;
  std::vector<CellResidual> residual;
  std::vector<uint8_t> fused, expected, dynamic, dynamic_before, border, scratch;
  std::vector<uint16_t> still, still_before;
  std::vector<int32_t> part, queue;
  std::vector<Part> parts;
};

inline constexpr Patch kBox = {20, 40, 30, 50};

}  // namespace stillmap
