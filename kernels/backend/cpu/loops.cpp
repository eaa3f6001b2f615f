// Loops over element functions, nothing else. Compiled with STILLMAP_LOOPS naming the table (see
// CMakeLists.txt).

#include "kernels/backend/cpu/loops.hpp"

#include <cstring>

#include "kernels/backend/cpu/lanes.hpp"

namespace stillmap {
namespace {

int32_t prepare(const PreparePass& pass, int32_t first_row, int32_t last_row) {
  int32_t valid = 0;
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.depth_m.cols; ++c) valid += pass(r, c);
  return valid;
}

using TrackBlocks = RecentBlocks<6>;
constexpr int32_t kBatch = 64;  ///< pixels of a row at a time: everything about them stays in the first cache

/// Points that have a value in the map, component by component.
struct PointBatch {
  alignas(32) uint32_t voxel[8][kBatch];
  alignas(32) float fraction[3][kBatch], arm[3][kBatch], luma[kBatch], trust[kBatch];
  int32_t size = 0;

  TrackPoint<Float8> at(int32_t first) const {
    TrackPoint<Float8> p;
    p.surface = Int8(0) == Int8(0);
    for (int32_t v = 0; v < 8; ++v) {
      const Int8 word = Int8::load(&voxel[v][first]), sdf = shift_right(word << 16, 16);
      p.sdf[v] = to_float(sdf);
      p.luma[v] = to_float(shift_right(word, 16) & Int8(0xffff));
      p.surface = p.surface & (sdf != Int8(kSdfMax));
    }
    p.fraction = {Float8::load(&fraction[0][first]), Float8::load(&fraction[1][first]),
                  Float8::load(&fraction[2][first])};
    p.arm = {Float8::load(&arm[0][first]), Float8::load(&arm[1][first]), Float8::load(&arm[2][first])};
    p.measured_luma = Float8::load(&luma[first]);
    return p;
  }
};

/// Pixels of a row, component by component, before the map is looked at.
struct PixelBatch {
  alignas(32) float arm[3][kBatch], fraction[3][kBatch];
  alignas(32) int32_t cell[3][kBatch], in_range[kBatch];
  int32_t size = 0;

  void fill(const TrackPass& pass, int32_t row, int32_t first_col, int32_t count, int32_t step) {
    size = count;
    const float* depth_m = pass.depth_m.row(row);
    for (int32_t i = 0; i < count; i += kLanes) {
      Float8 z_m(0.0f);
      for (int32_t l = 0; l < kLanes && i + l < count; ++l) z_m.v[l] = depth_m[first_col + (i + l) * step];
      const Float8 col = Float8(static_cast<float>(first_col + i * step)) +
                         Float8(static_cast<float>(step)) * Float8::ramp();
      const PixelPoint<Float8> p = pass.point_of(Float8(static_cast<float>(row)), col, z_m);
      p.arm.x.store(&arm[0][i]), p.arm.y.store(&arm[1][i]), p.arm.z.store(&arm[2][i]);
      p.cell.x.store(&cell[0][i]), p.cell.y.store(&cell[1][i]), p.cell.z.store(&cell[2][i]);
      p.cell.fraction.x.store(&fraction[0][i]), p.cell.fraction.y.store(&fraction[1][i]);
      p.cell.fraction.z.store(&fraction[2][i]);
      Int8(p.in_range.bits).store(&in_range[i]);
    }
  }

  /// Fetches the voxels of pixel `i` and appends it to `out`, unless one of them was never observed.
  void fetch(const TrackPass& pass, int32_t i, uint16_t measured_luma, float trust, TrackBlocks& cache,
             PointBatch& out) const {
    VoxelSurface voxel[8];
    if (!read_corners(pass.map, {cell[0][i], cell[1][i], cell[2][i]}, cache, voxel)) return;
    const int32_t n = out.size++;
    for (int32_t v = 0; v < 8; ++v) std::memcpy(&out.voxel[v][n], &voxel[v], 4);
    for (int32_t a = 0; a < 3; ++a) {
      out.fraction[a][n] = fraction[a][i];
      out.arm[a][n] = arm[a][i];
    }
    out.luma[n] = static_cast<float>(measured_luma);
    out.trust[n] = trust;
  }
};

NormalEqT<float> track(const TrackPass& pass, int32_t first_row, int32_t last_row, int32_t step) {
  Float8 sums[kTerms];
  for (Float8& s : sums) s = Float8(0.0f);
  PixelBatch pixels;
  PointBatch points = {};  // lanes beyond its size are read, and must be numbers
  TrackBlocks cache;
  float considered = 0;
  for (int32_t r = first_row; r < last_row; r += step)
    for (int32_t c0 = 0; c0 < pass.depth_m.cols; c0 += kBatch * step) {
      const int32_t left = (pass.depth_m.cols - c0 + step - 1) / step;
      pixels.fill(pass, r, c0, left < kBatch ? left : kBatch, step);
      points.size = 0;
      for (int32_t i = 0; i < pixels.size; ++i) {
        const int32_t c = c0 + i * step;
        const float trust = pass.trust01(r, c);
        if (!pixels.in_range[i] || trust == 0.0f) continue;
        considered += 1.0f;
        pixels.fetch(pass, i, pass.colour.at(r, c).luma, trust, cache, points);
      }
      for (int32_t i = 0; i < points.size; i += kLanes) {
        const TrackPoint<Float8> p = points.at(i);
        const Float8 live =
            select(Float8::ramp() < Float8(static_cast<float>(points.size - i)), Float8(1.0f), Float8(0.0f));
        add_point(point_terms(p, pass.weights), p.arm, live, Float8::load(&points.trust[i]), sums);
      }
    }
  NormalEqT<float> total;
  for (int32_t t = 0; t < kTerms; ++t)
    for (int32_t l = 0; l < kLanes; ++l) total.sum[t] += sums[t][l];
  total.sum[kConsidered] = considered;
  return total;
}

void residual_mask(const ResidualMaskPass& pass, int32_t first_row, int32_t last_row) {
  TrackBlocks cache;
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.depth_m.cols; ++c) pass(r, c, cache);
}

void cell_depth(const CellDepthPass& pass, int32_t first_row, int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.cells.depth_m.cols; ++c) pass(r, c);
}
void cell_normals(const CellNormalPass& pass, int32_t first_row, int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.cells.depth_m.cols; ++c) pass(r, c);
}
void cell_evidence(const CellEvidencePass& pass, int32_t first_row, int32_t last_row) {
  TrackBlocks cache;
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.cells.depth_m.cols; ++c) pass(r, c, cache);
}
void still_cells(const StillPass& pass, int32_t first_row, int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.cells.depth_m.cols; ++c) pass(r, c);
}
void static_pixels(const StaticPixelPass& pass, int32_t first_row, int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.depth_m.cols; ++c) pass(r, c);
}

void static_depth(const StaticDepthPass& pass, int32_t tile_row) {
  for (int32_t c = 0; c < pass.tiles.cols; ++c) pass(tile_row, c);
}

/// A row of eight voxels at a time; see IntegratePass. The words are those of VoxelSurface and VoxelRecord.
struct RowVoxels {
  using Number = Float8;
  static constexpr int32_t kCount = kLanes;
  static_assert(kLanes == kBlockEdge);

  STILLMAP_HD Mask8 all() const { return Int8(0) == Int8(0); }
  STILLMAP_HD bool any(Mask8 which) const { return which.any(); }
  STILLMAP_HD uint32_t bits(Mask8 which) const { return which.lanes(); }
  STILLMAP_HD Float8 ramp(int32_t) const { return Float8::ramp(); }
  STILLMAP_HD Int8 index(int32_t i) const { return Int8(i) + to_int(Float8::ramp()); }
  STILLMAP_HD VoxelState<Float8> load(const VoxelBlock& block, int32_t i) const {
    const Int8 s = Int8::load(&block.surface[i]), r = Int8::load(&block.record[i]), byte = Int8(0xff);
    return {to_float(shift_right(s << 16, 16)),
            to_float(shift_right(s, 16) & Int8(0xffff)),
            to_float(r & byte),
            to_float(shift_right(r, 8) & byte),
            to_float(shift_right(r, 16) & byte),
            to_float(shift_right(r, 24) & byte)};
  }
  STILLMAP_HD void store(VoxelBlock& block, int32_t i, const VoxelState<Float8>& v) const {
    const Int8 s = (to_int(v.sdf) & Int8(0xffff)) | (to_int(v.luma) << 16);
    const Int8 r =
        to_int(v.weight) | (to_int(v.colour_weight) << 8) | (to_int(v.cb) << 16) | (to_int(v.cr) << 24);
    s.store(&block.surface[i]);
    r.store(&block.record[i]);
  }
  STILLMAP_HD void load_colour(const LumaChroma* image, Int8 pixel, Float8& luma, Float8& cb,
                               Float8& cr) const {
    const Int8 word = gather_word(image, pixel), byte = Int8(0xff);
    luma = to_float(word & Int8(0xffff));
    cb = to_float(shift_right(word, 16) & byte);
    cr = to_float(shift_right(word, 24) & byte);
  }
};

GroupView visible_group(const VisibleGroupPass& pass, uint32_t group) {
  return pass(group, RowVoxels{});
}

void integrate(const IntegratePass& pass, View<const VisibleBlock> blocks) {
  for (const VisibleBlock block : blocks) pass(block, RowVoxels{});
}

}  // namespace

extern const CpuLoops STILLMAP_LOOPS;
const CpuLoops STILLMAP_LOOPS = {STILLMAP_LOOPS_NAME, prepare,      track,         residual_mask,
                                 cell_depth,          cell_normals, cell_evidence, still_cells,
                                 static_pixels,       static_depth, visible_group, integrate};

}  // namespace stillmap
