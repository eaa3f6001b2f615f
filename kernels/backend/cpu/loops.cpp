// Loops over element functions, nothing else. Compiled with STILLMAP_LOOPS naming the table (see
// CMakeLists.txt).

#include "kernels/backend/cpu/loops.hpp"

#include <algorithm>
#include <cstring>

#include "kernels/backend/cpu/lanes.hpp"

namespace stillmap {
namespace {

/// A row of a picture without distortion: every pixel stays where it is.
/// Metres once more, with the bias taken out. @return valid pixels
int32_t unbias_row(const PreparePass& pass, const uint16_t* raw, float* depth_m) {
  int32_t valid = 0;
  for (int32_t c = 0; c < pass.depth_m.cols; ++c) {
    const float z_m = metres_from_raw(raw[c], pass.m_per_unit, pass.min_m, pass.bias, pass.max_m);
    depth_m[c] = z_m;
    valid += static_cast<int32_t>(z_m > 0.0f) & static_cast<int32_t>(z_m <= pass.max_m);
  }
  return valid;
}

int32_t prepare_row(const PreparePass& pass, int32_t row) {
  const int32_t cols = pass.depth_m.cols, whole = cols / kLanes * kLanes;
  const uint16_t* raw = pass.depth_raw.row(row);
  const Rgb8* rgb = pass.colour_raw.row(row);
  float* depth_m = pass.depth_m.row(row);
  LumaChroma* luma_chroma = pass.luma_chroma_image.row(row);
  int32_t valid = 0;
  for (int32_t c = 0; c < cols; ++c) {
    const float z_m = metres_from_raw(raw[c], pass.m_per_unit, pass.min_m);
    depth_m[c] = z_m;
    valid += static_cast<int32_t>(z_m > 0.0f) & static_cast<int32_t>(z_m <= pass.max_m);
  }
  if (pass.biased) valid = unbias_row(pass, raw, depth_m);
  std::copy_n(rgb, cols, pass.colour.row(row));
  for (int32_t c = 0; c < whole; c += kLanes) {
    Int8 r, g, b;
    for (int32_t l = 0; l < kLanes; ++l) {
      r.v[l] = rgb[c + l].r;
      g.v[l] = rgb[c + l].g;
      b.v[l] = rgb[c + l].b;
    }
    luma_chroma_word(to_float(r), to_float(g), to_float(b)).store(luma_chroma + c);
  }
  for (int32_t c = whole; c < cols; ++c) luma_chroma[c] = stillmap::luma_chroma(rgb[c]);
  return valid;
}

int32_t prepare(const PreparePass& pass, int32_t first_row, int32_t last_row) {
  int32_t valid = 0;
  for (int32_t r = first_row; r < last_row; ++r)
    if (!pass.source_pixel.data)
      valid += prepare_row(pass, r);
    else
      for (int32_t c = 0; c < pass.depth_m.cols; ++c) valid += pass(r, c);
  return valid;
}

#if defined(__AVX2__)
/// Where the pixels of a run land.
struct LandedRun {
  static constexpr int32_t kMost = 16 * kLanes;
  int32_t first[kMost], extent[kMost], raw[kMost];

  void store(int32_t at, const LandedPixel<Int8>& landed) {
    landed.first.store(first + at);
    landed.extent.store(extent + at);
    landed.raw.store(raw + at);
  }
  LandedPixel<int32_t> operator[](int32_t i) const { return {first[i], extent[i], raw[i]}; }
};
#endif

template <bool kBent>
void register_row(const RegisterPass& pass, int32_t row, const uint16_t* raw, ImageView<uint16_t> out) {
  const float *x = pass.ray_x.row(row), *y = pass.ray_y.row(row), *z = pass.ray_z.row(row);
  int32_t c = 0;
#if defined(__AVX2__)  // elsewhere the compiler makes more of single pixels
  LandedRun run;
  while (c + kLanes <= pass.ray_x.cols) {
    int32_t landed = 0;
    for (; landed < LandedRun::kMost && c + kLanes <= pass.ray_x.cols; landed += kLanes, c += kLanes) {
      Int8 depth_raw;
      for (int32_t l = 0; l < kLanes; ++l) depth_raw.v[l] = raw[c + l];
      run.store(landed, pass.land<kBent>(Float8::load(x + c), Float8::load(y + c), Float8::load(z + c),
                                         depth_raw, out.pitch));
    }
    for (int32_t i = 0; i < landed; ++i) put_nearest(run[i], out);
  }
#endif
  for (; c < pass.ray_x.cols; ++c)
    put_nearest(pass.land<kBent>(x[c], y[c], z[c], int32_t{raw[c]}, out.pitch), out);
}

void register_depth(const RegisterPass& pass, const ImageView<const uint16_t>& depth_raw,
                    const ImageView<uint16_t>& registered_raw) {
  for (int32_t r = 0; r < registered_raw.rows; ++r)
    std::fill_n(registered_raw.row(r), registered_raw.cols, kRawFar);
  const bool bent = !pass.colour.distortion.none();
  for (int32_t r = 0; r < depth_raw.rows; ++r)
    bent ? register_row<true>(pass, r, depth_raw.row(r), registered_raw)
         : register_row<false>(pass, r, depth_raw.row(r), registered_raw);
  for (int32_t r = 0; r < registered_raw.rows; ++r) {
    uint16_t* out = registered_raw.row(r);
    for (int32_t c = 0; c < registered_raw.cols; ++c) out[c] = out[c] == kRawFar ? uint16_t{0} : out[c];
  }
}

using TrackBlocks = RecentBlocks<6>;
constexpr int32_t kBatch = 64;  ///< pixels of a row at a time: everything about them stays in the first cache

/// Pixels of a row with the voxels around them; what the arithmetic wants lies component by component.
struct PointBatch {
  alignas(32) float arm[3][kBatch], fraction[3][kBatch], luma[kBatch], trust[kBatch];
  alignas(32) int32_t cell[3][kBatch], in_range[kBatch];
  alignas(32) VoxelSurface voxel[kBatch][8];
  alignas(32) float known[kBatch];  ///< 1: measured, trusted, and its blocks are in the map

  /// Everything but the map. Pixels beyond `count` are out of range.
  /// @return how many are measured and trusted
  int32_t fill(const TrackPass& pass, int32_t row, int32_t first_col, int32_t count, int32_t step) {
    Int8 considered(0);
    for (int32_t i = 0; i < kBatch; i += kLanes) Float8(0.0f).store(&known[i]);
    for (int32_t i = 0; i < count; i += kLanes) {
      Float8 z_m(0.0f), measured(0.0f), trusted(0.0f);
      for (int32_t l = 0; l < kLanes && i + l < count; ++l) {
        const int32_t col = first_col + (i + l) * step;
        z_m.v[l] = pass.depth_m.at(row, col);
        measured.v[l] = static_cast<float>(pass.colour.at(row, col).luma);
        trusted.v[l] = pass.trust01(row, col);
      }
      const Float8 col = Float8(static_cast<float>(first_col + i * step)) +
                         Float8(static_cast<float>(step)) * Float8::ramp();
      const PixelPoint<Float8> p = pass.point_of(Float8(static_cast<float>(row)), col, z_m);
      p.arm.x.store(&arm[0][i]), p.arm.y.store(&arm[1][i]), p.arm.z.store(&arm[2][i]);
      p.cell.x.store(&cell[0][i]), p.cell.y.store(&cell[1][i]), p.cell.z.store(&cell[2][i]);
      p.cell.fraction.x.store(&fraction[0][i]), p.cell.fraction.y.store(&fraction[1][i]);
      p.cell.fraction.z.store(&fraction[2][i]);
      measured.store(&luma[i]), trusted.store(&trust[i]);
      const Int8 use((p.in_range & (trusted > Float8(0.0f))).bits);
      use.store(&in_range[i]);
      considered = considered - use;  // all ones is minus one
    }
    int32_t sum = 0;
    for (int32_t l = 0; l < kLanes; ++l) sum += considered[l];
    return sum;
  }

  /// The voxels around each pixel. Those that were kept; of the others first where they lie, so that the
  /// memory can be on its way, then those in one block, at last those across blocks: each loop does the same
  /// for every pixel.
  /// @param kept_cell, kept_corners KeptCorners, from the entry of the first pixel on  @param stride entries
  /// from one pixel to the next
  void fetch(const TrackPass& pass, int32_t count, TrackBlocks& cache, uint64_t* kept_cell,
             KeptCorners::Corners* kept_corners, int32_t stride) {
    const VoxelSurface* from[kBatch];
    int32_t fresh[kBatch], fetched = 0, across[kBatch], crossing = 0;
    for (int32_t i = 0; i < count; ++i) {
      known[i] = 0.0f;
      if (!in_range[i]) {
        Int8(0).store(voxel[i]);
        continue;
      }
      const Int3 base = {cell[0][i], cell[1][i], cell[2][i]};
      const uint64_t word = KeptCorners::cell_word(base), kept = kept_cell[i * stride];
      if ((kept & ~KeptCorners::kKnown) == word) {
        Int8::load(&kept_corners[i * stride]).store(voxel[i]);
        known[i] = kept & KeptCorners::kKnown ? 1.0f : 0.0f;
        continue;
      }
      kept_cell[i * stride] = word;
      fresh[fetched] = i;
      from[fetched] = pass.map.free_block->surface;
      const BlockAt block = lookup(pass.map, pack(block_of_voxel(base)), cache);
      if (block) {
        known[i] = 1.0f;
        from[fetched] = block.voxels->surface + index_in_block(base);
        __builtin_prefetch(from[fetched]);
        __builtin_prefetch(from[fetched] + kBlockEdge * kBlockEdge);
        across[crossing] = i;
        crossing += static_cast<int32_t>(lies_across(base)) | static_cast<int32_t>(block.seen != nullptr);
      }
      ++fetched;
    }
    // Those across blocks read something else of their block, here.
    for (int32_t n = 0; n < fetched; ++n) {
      constexpr int32_t y = kBlockEdge, z = kBlockEdge * kBlockEdge;
      const VoxelSurface* v = from[n];
      const int32_t i = fresh[n];
      std::memcpy(&voxel[i][0], v, 8);
      std::memcpy(&voxel[i][2], v + y, 8);
      std::memcpy(&voxel[i][4], v + z, 8);
      std::memcpy(&voxel[i][6], v + z + y, 8);
    }
    for (int32_t n = 0; n < crossing; ++n) {
      const int32_t i = across[n];
      if (fetch_corners(pass.map, {cell[0][i], cell[1][i], cell[2][i]}, cache, voxel[i])) continue;
      known[i] = 0.0f;
      Int8(0).store(voxel[i]);
    }
    for (int32_t n = 0; n < fetched; ++n) {
      const int32_t i = fresh[n];
      Int8::load(voxel[i]).store(&kept_corners[i * stride]);
      if (known[i] > 0.0f) kept_cell[i * stride] |= KeptCorners::kKnown;
    }
  }
  /// @return false: the map knows none of the eight pixels from `first` on
  bool any_known(int32_t first) const { return (Float8::load(&known[first]) > Float8(0.0f)).any(); }

  /// @param live 1, or 0 where a voxel was never observed
  TrackPoint<Float8> at(int32_t first, Float8& live) const {
    TrackPoint<Float8> p;
    Int8 word[8];
    transposed_words(&voxel[first], word);
    Mask8 observed = Int8(0) == Int8(0);
    p.surface = observed;
    for (int32_t v = 0; v < 8; ++v) {
      const Int8 sdf = shift_right(word[v] << 16, 16);
      p.sdf[v] = to_float(sdf);
      p.luma[v] = to_float(shift_right(word[v], 16) & Int8(0xffff));
      p.surface = p.surface & (sdf != Int8(kSdfMax));
      observed = observed & (sdf != Int8(kSdfUnobserved));
    }
    live = select(observed, Float8::load(&known[first]), Float8(0.0f));
    p.fraction = {Float8::load(&fraction[0][first]), Float8::load(&fraction[1][first]),
                  Float8::load(&fraction[2][first])};
    p.arm = {Float8::load(&arm[0][first]), Float8::load(&arm[1][first]), Float8::load(&arm[2][first])};
    p.measured_luma = Float8::load(&luma[first]);
    return p;
  }
};

NormalEqT<float> track(const TrackPass& pass, const KeptCorners& kept, int32_t first_row, int32_t last_row,
                       int32_t step) {
  Float8 sums[kTerms];
  for (Float8& s : sums) s = Float8(0.0f);
  PointBatch points;
  TrackBlocks cache;
  int32_t considered = 0;
  for (int32_t r = first_row; r < last_row; r += step)
    for (int32_t c0 = 0; c0 < pass.depth_m.cols; c0 += kBatch * step) {
      const int32_t left = (pass.depth_m.cols - c0 + step - 1) / step, count = left < kBatch ? left : kBatch;
      considered += points.fill(pass, r, c0, count, step);
      const int32_t kept_row = r / kept.step, kept_col = c0 / kept.step;
      points.fetch(pass, count, cache, kept.cell.row(kept_row) + kept_col,
                   kept.corners.row(kept_row) + kept_col, step / kept.step);
      for (int32_t i = 0; i < count; i += kLanes) {
        if (!points.any_known(i)) continue;
        Float8 live;
        const TrackPoint<Float8> p = points.at(i, live);
        add_point(point_terms(p, pass.weights), p.arm, live, Float8::load(&points.trust[i]), sums);
      }
    }
  NormalEqT<float> total;
  for (int32_t t = 0; t < kTerms; ++t)
    for (int32_t l = 0; l < kLanes; ++l) total.sum[t] += sums[t][l];
  total.sum[kConsidered] = static_cast<float>(considered);
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

/// End of the pixels of cell `cell` of `cells` ones along `pixels` pixels: what is left over is the last
/// one's.
int32_t end_of_cell(int32_t cell, int32_t cells, int32_t px, int32_t pixels) {
  return cell + 1 == cells ? pixels : (cell + 1) * px;
}

/// Where all cells around agree, which is most of the picture, no pixel is looked at.
void dynamic_pixels(const DynamicPixelPass& pass, int32_t first_row, int32_t last_row) {
  const CellGrid& cells = pass.cells;
  int32_t end_row = first_row;
  for (int32_t r0 = first_row; r0 < last_row; r0 = end_row) {
    const int32_t row = cell_row(cells, r0);
    end_row = std::min(last_row, end_of_cell(row, cells.depth_m.rows, cells.px, pass.mask.rows));
    for (int32_t cell = 0; cell < cells.depth_m.cols; ++cell) {
      const int32_t c0 = cell * cells.px,
                    c1 = end_of_cell(cell, cells.depth_m.cols, cells.px, pass.mask.cols);
      const bool all_agree = pass.all_agree(row, cell);
      const uint8_t value = is_dynamic(cells.dynamic.at(row, cell)) ? 255 : 0;
      for (int32_t r = r0; r < end_row; ++r)
        for (int32_t c = c0; c < c1; ++c)
          if (all_agree)
            pass.mask.at(r, c) = value;
          else
            pass(r, c);
    }
  }
}
void trust(const TrustPass& pass, int32_t first_row, int32_t last_row, int32_t step) {
  const CellGrid& cells = pass.cells;
  for (int32_t r = first_row; r < last_row; r += step) {
    const int32_t row = cell_row(cells, r);
    for (int32_t cell = 0, c = 0; cell < cells.depth_m.cols; ++cell) {
      const int32_t end = end_of_cell(cell, cells.depth_m.cols, cells.px, pass.depth_m.cols);
      for (; c < end; c += step) pass.in_cell(r, c, row, cell);
    }
  }
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
  STILLMAP_HD Float8 corner(int32_t, int32_t axis) const {
    return to_float(shift_right(to_int(Float8::ramp()), axis) & Int8(1));
  }
  STILLMAP_HD float least(Float8 x) const { return x.least(); }
  STILLMAP_HD float most(Float8 x) const { return x.most(); }
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

void start_depth(const StartDepthPass& pass, int32_t frame) {
  for (int32_t r = 0; r < pass.model.cell_rows; ++r)
    for (int32_t c = 0; c < pass.model.cell_cols; ++c) pass(frame, r, c);
}
void silent_cells(const SilentCellPass& pass) {
  for (int32_t r = 0; r < pass.silent.rows; ++r)
    for (int32_t c = 0; c < pass.silent.cols; ++c) pass(r, c);
}
void complete(const CompletePass& pass, int32_t first_row, int32_t last_row) {
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.depth_m.cols; ++c) pass(r, c);
}

}  // namespace

extern const CpuLoops STILLMAP_LOOPS;
const CpuLoops STILLMAP_LOOPS = {
    STILLMAP_LOOPS_NAME, prepare,       register_depth, track,          residual_mask, cell_depth,
    cell_normals,        cell_evidence, still_cells,    dynamic_pixels, trust,         static_depth,
    visible_group,       integrate,     start_depth,    silent_cells,   complete};

}  // namespace stillmap
