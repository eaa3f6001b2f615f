#pragma once

// The picture in cells: squares of pixels with one depth, one normal and one comparison with the map each.
// Whole parts are found on cells; their averages have a quarter of a pixel's noise.

#include <cmath>
#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/track/track_pass.hpp"

namespace stillmap {

constexpr int32_t kCellsAcross = 160;  ///< about so many cells in a row of the picture

STILLMAP_HD int32_t cell_px_for(int32_t image_cols) {
  const int32_t px = image_cols / kCellsAcross;
  return px < 1 ? 1 : px;
}

/// What the map says about a cell: 0 near the mapped surface, 1 well away from it (in space that was seen
/// free, or behind a surface by less than tau), between them doubt.
using Contradiction = float;
constexpr Contradiction kUnknown = -1.0f;  ///< no measurement, or nothing was ever observed there

/// Of a mask, and of an expected one: static, but not what the map says, or off its place for the first time;
/// no help to tracking.
constexpr uint8_t kDoubted = 1;

/// Dynamic, but only for its place: on a bend beside a dynamic part, or what the mask grew over.
constexpr uint8_t kTouched = 2;

STILLMAP_HD bool is_dynamic(uint8_t cell) {
  return cell > kDoubted;
}

/// From here on a cell counts as contradicting the map.
constexpr Contradiction kContradicts = 0.5f;

/// A frame that shows another brightness takes back so many of the frames that a cell stood still: noise
/// alone does it now and then.
constexpr int32_t kOtherLumaFrames = 8;
constexpr int32_t kRimCells = 4;    ///< a surface that comes into view goes on from its rim, if this near
constexpr float kSameLuma = 0.1f;   ///< of white: brightness that noise and resampling change
constexpr float kStillM = 0.01f;    ///< what stands still may seem to lie off, without noise
constexpr float kNearestM = 0.05f;  ///< nearer than this nothing is projected

/// Standard deviation of a depth measurement, metres.
struct DepthNoise {
  float close_m, per_m2;
  float lateral_per_m;  ///< of where a ray meets the surface, across the ray, at 1 m

  STILLMAP_HD float at(float z_m) const { return close_m + per_m2 * z_m * z_m; }
  /// Variance of the distance to a surface: along its normal little of the depth's noise is left where it is
  /// seen at a grazing angle, but there it matters which point of it was met.
  /// @param cos2 squared cosine between ray and normal
  STILLMAP_HD float variance_m2(float z_m, float cos2) const {
    const float along_m = at(z_m), across_m = lateral_per_m * z_m;
    return cos2 * along_m * along_m + (1.0f - cos2) * across_m * across_m;
  }
  /// At an edge of depth, which no surface's slope limits.
  STILLMAP_HD float edge_variance_m2(float z_m) const {
    constexpr float kEdgeSlope2 = 4.0f;
    const float along_m = at(z_m), across_m = lateral_per_m * z_m;
    return along_m * along_m + kEdgeSlope2 * across_m * across_m;
  }
};

/// @param k of the full picture: a lateral pixel is one of 640 columns
inline DepthNoise depth_noise(const DepthParams& params, const Intrinsics& k) {
  const float px = params.noise_lateral_px * static_cast<float>(k.width) / 640.0f;
  return {params.noise_m, params.noise_per_m2, px / k.fx};
}

/// A cell against the map: what it adds to the least squares of its part (paper Eq. (4), at one point).
struct CellResidual {
  PointTerms<float> terms;  ///< depth_weight 0: no surface in the map there
  Vec3 arm;                 ///< camera centre to point, metres, map axes
};

/// The index of 0..size-1 that is nearest to `i`.
STILLMAP_HD int32_t nearest_index(int32_t i, int32_t size) {
  return i < 0 ? 0 : i < size ? i : size - 1;
}

/// Images of the size of the cell grid.
struct CellGrid {
  int32_t px = 4;            ///< pixels along the edge of a cell
  Intrinsics k;              ///< of the grid: cell (r, c) is pixel (r, c) of this camera
  ImageView<float> depth_m;  ///< mean of the pixels on one surface; 0: none
  ImageView<float> luma;     ///< mean of the same pixels, kLumaScale is white
  ImageView<Vec3> normal;    ///< camera frame, towards the camera; 0: none
  ImageView<Contradiction> evidence;
  ImageView<CellResidual> residual;
  ImageView<uint8_t> fused;     ///< measurements that made the map's surface there; few: it is on probation
  ImageView<float> crept_m;     ///< how far it has gone along its normal in that time
  ImageView<uint16_t> still;    ///< frames that the surface in a cell has been where it is, at most 65535
  ImageView<uint8_t> dynamic;   ///< 0: static, kDoubted, kTouched, or 255: dynamic
  ImageView<uint8_t> expected;  ///< kDoubted, or dynamic by the last frame's mask, carried into this one
  int32_t settled_frames = 0;   ///< mask.reabsorb_s: what is still for so many is static; 0: never
  float drift_m = 0;            ///< how far the map may not fit itself, see mask.drift
  ImageView<int32_t> part;      ///< number of the connected part a cell belongs to; < 0: none

  STILLMAP_HD Vec3 point(int32_t row, int32_t col) const {
    return unproject(k, static_cast<float>(col), static_cast<float>(row), depth_m.at(row, col));
  }
};

/// A jump between neighbouring measurements that parts two surfaces: more than a slanted surface shows from
/// one cell to the next, and never less than what the sensor smears at an edge.
STILLMAP_HD float depth_edge_m(float z_m) {
  constexpr float kShare = 0.025f, kLeastM = 0.03f;
  return max_of(kShare * z_m, kLeastM);
}

/// Depth of one cell: the mean of the pixels that lie on the surface in its middle.
struct CellDepthPass {
  ImageView<const float> depth_m;
  ImageView<const LumaChroma> colour;
  CellGrid cells;
  float max_m = 0;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    const int32_t r0 = row * cells.px, c0 = col * cells.px;
    const float middle_m = reference(r0, c0);
    float sum = 0, luma = 0, count = 0;
    for (int32_t r = r0; middle_m > 0.0f && r < r0 + cells.px; ++r)
      for (int32_t c = c0; c < c0 + cells.px; ++c) {
        const float z_m = depth_m.at(r, c);
        if (!usable(z_m) || fabsf(z_m - middle_m) > depth_edge_m(middle_m)) continue;
        sum += z_m;
        luma += static_cast<float>(colour.at(r, c).luma);
        count += 1.0f;
      }
    cells.depth_m.at(row, col) = count > 0.0f ? sum / count : 0.0f;
    cells.luma.at(row, col) = count > 0.0f ? luma / count : 0.0f;
  }

 private:
  STILLMAP_HD bool usable(float z_m) const { return z_m > 0.0f && z_m <= max_m; }
  /// Depth of the pixel in the middle, or of the first one that has any.
  STILLMAP_HD float reference(int32_t r0, int32_t c0) const {
    const int32_t middle = cells.px / 2;
    if (usable(depth_m.at(r0 + middle, c0 + middle))) return depth_m.at(r0 + middle, c0 + middle);
    for (int32_t r = r0; r < r0 + cells.px; ++r)
      for (int32_t c = c0; c < c0 + cells.px; ++c)
        if (usable(depth_m.at(r, c))) return depth_m.at(r, c);
    return 0.0f;
  }
};

/// Normal of one cell from its neighbours on the same surface.
struct CellNormalPass {
  CellGrid cells;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    Vec3 across, down;
    Vec3 n = {};
    if (cells.depth_m.at(row, col) > 0.0f && difference(row, col, 0, 1, across) &&
        difference(row, col, 1, 0, down)) {
      n = cross(down, across);
      const float size = norm(n);
      n = size > 0.0f ? (1.0f / size) * n : Vec3{};
    }
    cells.normal.at(row, col) = n;
  }

 private:
  STILLMAP_HD bool difference(int32_t row, int32_t col, int32_t dr, int32_t dc, Vec3& d) const {
    const bool before = same_surface(row, col, row - dr, col - dc);
    const bool after = same_surface(row, col, row + dr, col + dc);
    if (!before && !after) return false;
    const Vec3 from = before ? cells.point(row - dr, col - dc) : cells.point(row, col);
    const Vec3 to = after ? cells.point(row + dr, col + dc) : cells.point(row, col);
    d = to - from;
    return true;
  }
  STILLMAP_HD bool same_surface(int32_t row, int32_t col, int32_t r, int32_t c) const {
    if (!cells.depth_m.contains(r, c)) return false;
    const float a = cells.depth_m.at(row, col), b = cells.depth_m.at(r, c);
    return b > 0.0f && fabsf(a - b) <= 2.0f * depth_edge_m(a);
  }
};

/// Compares one cell with the map at a pose.
struct CellEvidencePass {
  CellGrid cells;
  TrackPass track;  ///< its pose, map and weights; the camera is that of the grid
  DepthNoise noise;
  float contradict_m;
  float contradict_sigmas;
  int32_t empty_looks = 1;         ///< space that was seen free less often says nothing
  int32_t empty_reach_voxels = 0;  ///< and so its neighbours; 0: they are not asked
  int32_t drift_voxels = 0;        ///< free space this near to a mapped surface says nothing either

  template <class Cache>
  STILLMAP_HD void operator()(int32_t row, int32_t col, Cache& cache) const {
    const float z_m = cells.depth_m.at(row, col);
    CellResidual residual = {};
    Contradiction contradiction = kUnknown;
    uint8_t fused = 0;
    TrackPoint<float> point;
    if (track.fetch(row, col, z_m, cells.luma.at(row, col), cache, point)) {
      residual.terms = point_terms(point, track.weights);
      residual.arm = point.arm;
      const float limit_m =
          min_of(contradict_m + contradict_sigmas * noise.at(z_m), 0.9f * track.map.truncation_m);
      const float off = fabsf(residual.terms.depth_residual_m) / limit_m;
      contradiction = min_of(max_of(2.0f * (off - 0.5f), 0.0f), 1.0f);
      if (contradiction > 0.0f && behind_another(row, col, residual.terms)) contradiction = kUnknown;
      const Int3 voxel =
          nearest_voxel(track.point_of(static_cast<float>(row), static_cast<float>(col), z_m).cell);
      fused = record_at(voxel, cache).colour_weight;
      const bool in_free_space = residual.terms.depth_residual_m > 0.0f;
      if (contradiction > 0.0f && in_free_space && !reliably_empty(voxel, cache)) contradiction = kUnknown;
    }
    cells.fused.at(row, col) = fused;
    cells.residual.at(row, col) = residual;
    cells.evidence.at(row, col) = contradiction;
  }

 private:
  /// Behind a mapped surface that faces elsewhere: it has gone, and says nothing of what is seen now.
  STILLMAP_HD bool behind_another(int32_t row, int32_t col, const PointTerms<float>& terms) const {
    constexpr float kSameFacing = 0.5f;
    const Vec3 facing = track.T_map_cam.rotation * cells.normal.at(row, col), towards = terms.depth_gradient;
    return terms.depth_residual_m < 0.0f && dot(facing, facing) > 0.5f &&
           dot(facing, towards) < kSameFacing * norm(towards);
  }
  STILLMAP_HD static Int3 nearest_voxel(const GridCell<float>& cell) {
    const auto up = [](float fraction) { return fraction >= 0.5f ? 1 : 0; };
    return {cell.x + up(cell.fraction.x), cell.y + up(cell.fraction.y), cell.z + up(cell.fraction.z)};
  }
  template <class Cache>
  STILLMAP_HD VoxelRecord record_at(Int3 voxel, Cache& cache) const {
    const BlockAt block = lookup(track.map, pack(block_of_voxel(voxel)), cache);
    return block ? block.record(index_in_block(voxel)) : VoxelRecord{};
  }
  template <class Cache>
  STILLMAP_HD VoxelSurface surface_at(Int3 voxel, Cache& cache) const {
    const BlockAt block = lookup(track.map, pack(block_of_voxel(voxel)), cache);
    return block ? block.surface(index_in_block(voxel)) : VoxelSurface{};
  }
  /// Seen often enough, here and around: what was looked at once may have been noise, or a hole in a mover.
  /// Beside a thing whose other side was not seen yet, a map that has drifted has free space where that is.
  template <class Cache>
  STILLMAP_HD bool reliably_empty(Int3 voxel, Cache& cache) const {
    if (record_at(voxel, cache).weight < empty_looks) return false;
    const bool seen_around = all_around(voxel, empty_reach_voxels, [&](Int3 neighbour) {
      return record_at(neighbour, cache).weight >= empty_looks;
    });
    return seen_around && all_around(voxel, drift_voxels, [&](Int3 neighbour) {
             const VoxelSurface surface = surface_at(neighbour, cache);
             return surface.sdf == kSdfUnobserved || surface.sdf > 0;
           });
  }
  /// Of the six neighbours at a distance, 0: none.
  template <class F>
  STILLMAP_HD static bool all_around(Int3 voxel, int32_t distance, const F& holds) {
    for (int32_t i = 0; distance > 0 && i < 6; ++i) {
      const int32_t step = i & 1 ? distance : -distance, axis = i >> 1;
      if (!holds(Int3{voxel.x + (axis == 0 ? step : 0), voxel.y + (axis == 1 ? step : 0),
                      voxel.z + (axis == 2 ? step : 0)}))
        return false;
    }
    return true;
  }
};

/// What a cell showed in the last frame.
struct CellsBefore {
  ImageView<float> depth_m, luma, crept_m;
  ImageView<uint8_t> dynamic;
  ImageView<uint16_t> still;
};

/// Counts for how many frames the surface of a cell has been in its place: the last frame, looked at from
/// this one, must show the same surface and brightness there, and it may not creep away either.
struct StillPass {
  CellGrid cells;
  CellsBefore before;
  Se3 T_before_now;
  DepthNoise noise;
  int32_t most_rim_frames = 0;  ///< what comes into view has stood still for no more of them

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    int32_t frames = 0;
    float crept_m = 0;
    if (cells.depth_m.at(row, col) > 0.0f) look_back(row, col, frames, crept_m);
    cells.crept_m.at(row, col) = crept_m;
    cells.still.at(row, col) = static_cast<uint16_t>(frames < 0 ? 0 : frames < 65535 ? frames : 65535);
  }

 private:
  STILLMAP_HD static bool near_view(int32_t i, int32_t size) {
    return i >= -kRimCells && i < size + kRimCells;
  }
  STILLMAP_HD void look_back(int32_t row, int32_t col, int32_t& frames, float& crept_m) const {
    const Vec3 p = T_before_now * cells.point(row, col);
    if (p.z < kNearestM) return;
    const Pixel at = project(cells.k, p);
    const int32_t at_r = static_cast<int32_t>(floorf(at.v + 0.5f)),
                  at_c = static_cast<int32_t>(floorf(at.u + 0.5f));
    if (!near_view(at_r, before.depth_m.rows) || !near_view(at_c, before.depth_m.cols)) return;
    const int32_t r = nearest_index(at_r, before.depth_m.rows), c = nearest_index(at_c, before.depth_m.cols);
    const bool seen = r == at_r && c == at_c;
    if (before.depth_m.at(r, c) <= 0.0f) return;
    const Vec3 was =
        unproject(cells.k, static_cast<float>(c), static_cast<float>(r), before.depth_m.at(r, c));
    // Along the normal: the cell need not be met in its middle.
    const float off_m =
        before.crept_m.at(r, c) + dot(T_before_now.rotation * cells.normal.at(row, col), p - was);
    const float z_m = cells.depth_m.at(row, col), near_m = kStillM + 2.0f * noise.at(z_m);
    if (fabsf(was.z - p.z) > depth_edge_m(z_m) + near_m || fabsf(off_m) > near_m) return;
    crept_m = off_m;
    if (!seen) {
      frames = before.still.at(r, c) < most_rim_frames ? before.still.at(r, c) : most_rim_frames;
      return;
    }
    const bool same = fabsf(before.luma.at(r, c) - cells.luma.at(row, col)) < kSameLuma * kLumaScale;
    frames = before.still.at(r, c) + (same ? 1 : -kOtherLumaFrames);
  }
};

}  // namespace stillmap
