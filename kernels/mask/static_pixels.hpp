#pragma once

// From cells back to pixels: which are dynamic, and how far tracking may trust each.

#include <cmath>
#include <cstdint>

#include "kernels/mask/cells.hpp"

namespace stillmap {

/// The cell that a pixel belongs to; those on a rim narrower than a cell belong to the last one.
STILLMAP_HD int32_t cell_row(const CellGrid& cells, int32_t row) {
  return nearest_index(row / cells.px, cells.depth_m.rows);
}
STILLMAP_HD int32_t cell_col(const CellGrid& cells, int32_t col) {
  return nearest_index(col / cells.px, cells.depth_m.cols);
}

/// Of one pixel: dynamic or not, from the cell of its surface.                       test: parts_test
struct DynamicPixelPass {
  CellGrid cells;
  ImageView<const float> depth_m;
  ImageView<uint8_t> mask;  ///< 255: dynamic

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    mask.at(row, col) =
        dynamic_at(cell_row(cells, row), cell_col(cells, col), depth_m.at(row, col)) ? 255 : 0;
  }
  /// True when the depth of a pixel in cell (r, c) does not matter: all cells that it can belong to agree.
  STILLMAP_HD bool all_agree(int32_t r, int32_t c) const {
    const bool own = is_dynamic(cells.dynamic.at(r, c));
    for (int32_t i = 0; i < 9; ++i) {
      const int32_t nr = r + i / 3 - 1, nc = c + i % 3 - 1;
      if (cells.dynamic.contains(nr, nc) && is_dynamic(cells.dynamic.at(nr, nc)) != own) return false;
    }
    return true;
  }

 private:
  /// The cell around, or, where its surface is another one, the neighbour whose depth is nearest. Between two
  /// surfaces (a flying pixel) the dynamic one has it.
  STILLMAP_HD bool dynamic_at(int32_t r, int32_t c, float z_m) const {
    const bool own = is_dynamic(cells.dynamic.at(r, c));
    const float cell_m = cells.depth_m.at(r, c);
    if (z_m <= 0.0f) return own;
    if (cell_m > 0.0f && fabsf(cell_m - z_m) <= depth_edge_m(z_m)) return own;
    float best_m = depth_edge_m(z_m);
    bool found = false, dynamic = false, any = own;
    for (int32_t i = 0; i < 9; ++i) {
      const int32_t nr = r + i / 3 - 1, nc = c + i % 3 - 1;
      if (!cells.depth_m.contains(nr, nc)) continue;
      const bool here = is_dynamic(cells.dynamic.at(nr, nc));
      const float away_m = fabsf(cells.depth_m.at(nr, nc) - z_m);
      any |= here;
      if (cells.depth_m.at(nr, nc) > 0.0f && away_m <= best_m) {
        best_m = away_m;
        found = true;
        dynamic = here;
      }
    }
    return found ? dynamic : any;
  }
};

/// How far tracking may trust one pixel.                                             test: parts_test
struct TrustPass {
  CellGrid cells;
  ImageView<const float> depth_m;
  ImageView<const uint8_t> mask;  ///< 255: dynamic; no data: cells.expected decides for the whole cell
  ImageView<uint8_t> trust;       ///< see TrackPass
  DepthNoise noise;
  float trust_noise_m = 0;  ///< 0: noise changes no trust
  float trust_area_m = 0;
  float probation_trust = 1;         ///< of what the map has seen too seldom for its mesh
  int32_t probation_ends_after = 0;  ///< measurements

  /// What is expected to move keeps this much trust until the mask is known: it may have stopped.
  static constexpr float kExpectedTrust = 0.1f;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    in_cell(row, col, cell_row(cells, row), cell_col(cells, col));
  }
  /// @param r, c the cell of pixel (row, col)
  STILLMAP_HD void in_cell(int32_t row, int32_t col, int32_t r, int32_t c) const {
    const float z_m = depth_m.at(row, col);
    const bool dynamic = mask.data ? mask.at(row, col) != 0 : cells.expected.at(r, c) != 0;
    float t = 255.0f;
    if (trust_noise_m > 0.0f) {
      const float s2 = trust_noise_m * trust_noise_m;
      t *= s2 / (s2 + variance_m2(r, c, z_m));
    }
    if (trust_area_m > 0.0f && !mask.data) {
      const float s = z_m / trust_area_m;
      t *= s < 1.0f ? s * s : 1.0f;
    }
    if (mask.data && cells.evidence.at(r, c) >= kContradicts) t = 0.0f;
    if (mask.data && cells.fused.at(r, c) < probation_ends_after) t *= probation_trust;
    if (dynamic) t *= mask.data ? 0.0f : kExpectedTrust;
    trust.at(row, col) = static_cast<uint8_t>(t + 0.5f);
  }

 private:
  /// Of the distance of a pixel in cell (r, c) to its surface.
  STILLMAP_HD float variance_m2(int32_t r, int32_t c, float z_m) const {
    const Vec3 normal = cells.normal.at(r, c), ray = cells.point(r, c);
    const float facing = dot(normal, ray);
    const bool on_cell = facing != 0.0f && fabsf(cells.depth_m.at(r, c) - z_m) <= depth_edge_m(z_m);
    return on_cell ? noise.variance_m2(z_m, facing * facing / dot(ray, ray)) : noise.edge_variance_m2(z_m);
  }
};

}  // namespace stillmap
