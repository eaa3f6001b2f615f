#include "kernels/mask/parts.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/mask/carry_mask.hpp"

namespace stillmap {
namespace {

constexpr uint8_t kSet = 255;

constexpr float kJoinedM = 0.02f;    ///< neighbouring cells this near in depth are one surface, without noise
constexpr float kOnePlaneM = 0.01f;  ///< and so are cells this near to each other's plane
constexpr float kSettledShare = 0.6f;  ///< of a part that stands still: the rest is its rim
constexpr float kStillMovesShare =
    0.6f;  ///< of the offset that shows a mover keeps it one: it may swing back
constexpr float kSlidShare =
    0.6f;  ///< of what it may lie off: so much a part has slid that moved, and not the map under it
constexpr float kHardlyKnownShare = 0.2f;  ///< of a part: the map knows too little to say what it is
constexpr double kNearShare =
    0.5;  ///< of a part must lie near a mapped surface, that it can have moved from it
constexpr float kMostOfTheSpace = 0.5f;  ///< with more of it on the move nothing was agreed on

bool has_normal(Vec3 n) {
  return dot(n, n) > 0.5f;
}

/// On a concave bend between the cells two before and two behind it along a row or column; fewer where the
/// picture ends.
bool concave(const CellGrid& cells, int32_t r, int32_t c, int32_t dr, int32_t dc, float cos_bend) {
  const int32_t rows = cells.depth_m.rows, cols = cells.depth_m.cols;
  const int32_t r0 = nearest_index(r - 2 * dr, rows), c0 = nearest_index(c - 2 * dc, cols),
                r1 = nearest_index(r + 2 * dr, rows), c1 = nearest_index(c + 2 * dc, cols);
  const Vec3 n0 = cells.normal.at(r0, c0), n1 = cells.normal.at(r1, c1);
  if (!has_normal(n0) || !has_normal(n1) || dot(n0, n1) > cos_bend) return false;
  return dot(cells.point(r1, c1) - cells.point(r0, c0), n1 - n0) < 0.0f;
}

/// Neighbouring cells on one surface: each lies in the plane of the other, or there is hardly any jump.
bool joined(const CellGrid& cells, int32_t ra, int32_t ca, int32_t rb, int32_t cb, const DepthNoise& noise) {
  const float za = cells.depth_m.at(ra, ca), zb = cells.depth_m.at(rb, cb);
  if (za <= 0.0f || zb <= 0.0f) return false;
  const float jump_m = std::fabs(za - zb);
  if (jump_m < kJoinedM + 2.0f * noise.at(za)) return true;
  const Vec3 na = cells.normal.at(ra, ca), nb = cells.normal.at(rb, cb);
  if (!has_normal(na) || !has_normal(nb)) return false;
  const Vec3 step = cells.point(rb, cb) - cells.point(ra, ca);
  const float tolerance_m = kOnePlaneM + 2.0f * noise.at(za);
  return std::fabs(dot(na, step)) < tolerance_m && std::fabs(dot(nb, step)) < tolerance_m &&
         jump_m < 4.0f * depth_edge_m(za);
}

/// Stood still for so long that it is static, whatever the map says.
bool settled(const CellGrid& cells, int32_t r, int32_t c) {
  return cells.settled_frames > 0 && cells.still.at(r, c) >= cells.settled_frames;
}

bool stands(const Part& part) {
  return static_cast<float>(part.settled) > kSettledShare * static_cast<float>(part.cells);
}

float cell_area_m2(const CellGrid& cells, int32_t r, int32_t c) {
  const float edge_m = cells.depth_m.at(r, c) / cells.k.fx;
  return edge_m * edge_m;
}

/// Visits the four neighbours.
template <class F>
void for_neighbours(int32_t r, int32_t c, const ImageView<float>& image, const F& f) {
  constexpr int32_t dr[4] = {0, 0, -1, 1}, dc[4] = {-1, 1, 0, 0};
  for (int32_t i = 0; i < 4; ++i)
    if (image.contains(r + dr[i], c + dc[i])) f(r + dr[i], c + dc[i]);
}

/// Numbers the part that holds `start` by a flood over joined cells.
void flood(const CellGrid& cells, const PartMemory& memory, const DepthNoise& noise, int32_t start,
           int32_t number) {
  const int32_t cols = cells.part.cols;
  uint32_t tail = 0;
  memory.queue[tail++] = start;
  cells.part.data[start] = number;
  for (uint32_t head = 0; head < tail; ++head) {
    const int32_t r = memory.queue[head] / cols, c = memory.queue[head] % cols;
    for_neighbours(r, c, cells.depth_m, [&](int32_t nr, int32_t nc) {
      if (cells.part.at(nr, nc) >= 0 || memory.border.at(nr, nc) || !joined(cells, r, c, nr, nc, noise))
        return;
      cells.part.at(nr, nc) = number;
      memory.queue[tail++] = nr * cols + nc;
    });
  }
}

/// Gives the cells on bends to the neighbouring part that is nearest in depth.
void settle_borders(const CellGrid& cells, const PartMemory& memory) {
  constexpr int32_t kPasses = 3;  // bends are two cells wide on each side
  for (int32_t pass = 0; pass < kPasses; ++pass)
    for (int32_t r = 0; r < cells.part.rows; ++r)
      for (int32_t c = 0; c < cells.part.cols; ++c) {
        if (cells.part.at(r, c) >= 0 || cells.depth_m.at(r, c) <= 0.0f || !memory.border.at(r, c)) continue;
        float best_m = depth_edge_m(cells.depth_m.at(r, c));
        for_neighbours(r, c, cells.depth_m, [&](int32_t nr, int32_t nc) {
          const float away_m = std::fabs(cells.depth_m.at(nr, nc) - cells.depth_m.at(r, c));
          if (cells.part.at(nr, nc) < 0 || away_m >= best_m) return;
          best_m = away_m;
          cells.part.at(r, c) = cells.part.at(nr, nc);
        });
      }
}

/// Sets `value` in connected areas of cells that are `wanted` and whose core (cells with nothing else beside
/// them) is large enough: what is only a rim along an edge of the map does not count.
template <class Wanted>
void set_blobs(const CellGrid& cells, const PartMemory& memory, float min_core_m2, uint8_t value,
               const Wanted& wanted) {
  const int32_t rows = cells.part.rows, cols = cells.part.cols;
  const ImageView<uint8_t> seen = memory.scratch;
  std::fill_n(seen.data, seen.pixels(), uint8_t{0});
  const auto core = [&](int32_t r, int32_t c) {
    bool inner = true;
    for_neighbours(r, c, cells.depth_m, [&](int32_t nr, int32_t nc) { inner = inner && wanted(nr, nc); });
    return inner;
  };
  for (int32_t start = 0; start < rows * cols; ++start) {
    if (seen.data[start] || !wanted(start / cols, start % cols)) continue;
    uint32_t tail = 0;
    float core_m2 = 0;
    memory.queue[tail++] = start;
    seen.data[start] = kSet;
    for (uint32_t head = 0; head < tail; ++head) {
      const int32_t r = memory.queue[head] / cols, c = memory.queue[head] % cols;
      if (core(r, c)) core_m2 += cell_area_m2(cells, r, c);
      for_neighbours(r, c, cells.depth_m, [&](int32_t nr, int32_t nc) {
        const float jump_m = std::fabs(cells.depth_m.at(nr, nc) - cells.depth_m.at(r, c));
        if (seen.at(nr, nc) || !wanted(nr, nc) || jump_m > 2 * depth_edge_m(cells.depth_m.at(r, c))) return;
        seen.at(nr, nc) = kSet;
        memory.queue[tail++] = nr * cols + nc;
      });
    }
    if (core_m2 < min_core_m2) continue;
    for (uint32_t i = 0; i < tail; ++i) cells.dynamic.data[memory.queue[i]] = value;
  }
}

/// Grows what is dynamic over what touches it, `grow_m` far.
void grow(const CellGrid& cells, const PartMemory& memory, float grow_m) {
  const ImageView<uint8_t> found = memory.scratch;
  std::copy_n(cells.dynamic.data, cells.dynamic.pixels(), found.data);
  for (int32_t r = 0; r < found.rows; ++r)
    for (int32_t c = 0; c < found.cols; ++c) {
      const float z_m = cells.depth_m.at(r, c);
      if (!is_dynamic(found.at(r, c)) || z_m <= 0.0f) continue;
      const int32_t reach = std::min(8, static_cast<int32_t>(grow_m * cells.k.fx / z_m + 0.5f));
      for (int32_t nr = std::max(r - reach, 0); nr <= std::min(r + reach, found.rows - 1); ++nr)
        for (int32_t nc = std::max(c - reach, 0); nc <= std::min(c + reach, found.cols - 1); ++nc)
          if (!is_dynamic(found.at(nr, nc)) &&
              std::fabs(cells.depth_m.at(nr, nc) - z_m) < grow_m + depth_edge_m(z_m))
            cells.dynamic.at(nr, nc) = kTouched;
    }
}

}  // namespace

void find_bends(const CellGrid& cells, const PartMemory& memory, const MaskParams& params, int32_t first_row,
                int32_t last_row) {
  const float cos_bend = std::cos(params.part_concave_deg * 3.14159265f / 180.0f);
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < cells.part.cols; ++c) {
      const bool bend = concave(cells, r, c, 0, 1, cos_bend) || concave(cells, r, c, 1, 0, cos_bend);
      memory.border.at(r, c) = bend ? kSet : uint8_t{0};
    }
}

int32_t segment(const CellGrid& cells, const PartMemory& memory, const DepthNoise& noise) {
  const int32_t rows = cells.part.rows, cols = cells.part.cols;
  std::fill_n(cells.part.data, cells.part.pixels(), -1);
  int32_t parts = 0;
  for (int32_t i = 0; i < rows * cols; ++i)
    if (cells.part.data[i] < 0 && cells.depth_m.data[i] > 0.0f && !memory.border.data[i])
      flood(cells, memory, noise, i, parts++);
  settle_borders(cells, memory);
  return parts;
}

namespace {

void add_to_box(Part& part, int32_t r, int32_t c) {
  if (part.cells == 0) {
    part.row0 = r;
    part.col0 = part.col1 = c;
  }
  part.row1 = r + 1;  // rows come in order
  part.col0 = std::min(part.col0, c);
  part.col1 = std::max(part.col1, c + 1);
}

}  // namespace

void gather_parts(const CellGrid& cells, int32_t parts, const PartMemory& memory, const DepthNoise& noise) {
  for (int32_t i = 0; i < parts; ++i) memory.parts[static_cast<uint32_t>(i)] = {};
  for (int32_t r = 0; r < cells.part.rows; ++r) {
    // Neighbours mostly belong to one part: what they say of its motion is added up first.
    NormalEqT<float> run;
    int32_t run_of = -1;
    const auto end_run = [&](int32_t next) {
      if (run_of >= 0) memory.parts[static_cast<uint32_t>(run_of)].motion.add(run);
      run = {};
      run_of = next;
    };
    for (int32_t c = 0; c < cells.part.cols; ++c) {
      if (cells.part.at(r, c) < 0) continue;
      Part& part = memory.parts[static_cast<uint32_t>(cells.part.at(r, c))];
      const Contradiction contradiction = cells.evidence.at(r, c);
      add_to_box(part, r, c);
      ++part.cells;
      part.settled += settled(cells, r, c);
      part.expected += is_dynamic(cells.expected.at(r, c));
      part.expected_or_doubted += cells.expected.at(r, c) != 0;
      part.expected_inside += cells.expected.at(r, c) > kTouched;
      const float area_m2 = cell_area_m2(cells, r, c);
      part.area_m2 += area_m2;
      part.noise_m += noise.at(cells.depth_m.at(r, c));
      if (contradiction >= 0.0f) {
        part.known += 1.0f;
        part.contradicts += contradiction;
        part.contradicts_m2 += contradiction * area_m2;
      }
      const CellResidual& residual = cells.residual.at(r, c);
      if (residual.terms.depth_weight > 0.0f) {
        if (cells.part.at(r, c) != run_of) end_run(cells.part.at(r, c));
        add_point(residual.terms, residual.arm, 1.0f, 1.0f, run.sum);
      }
    }
    end_run(-1);
  }
  for (int32_t i = 0; i < parts; ++i) {
    Part& part = memory.parts[static_cast<uint32_t>(i)];
    if (part.cells > 0) part.noise_m /= static_cast<float>(part.cells);
    part.near_map = part.motion.sum[kPoints] > kNearShare * part.cells;
  }
}

namespace {

constexpr double kSlack = 1e-3;    ///< keeps what a part does not show at rest
constexpr double kMinPoints = 20;  ///< of a part that may vote

/// b + A x = 0 of a part, per point.
struct PartSystem {
  double a[21], b[6];

  explicit PartSystem(const NormalEq& sums) {
    const double inv = 1.0 / sums.sum[kWeight];
    for (int32_t i = 0; i < 21; ++i) a[i] = inv * sums.sum[kHessian + i];
    for (int32_t i = 0; i < 6; ++i) b[i] = inv * sums.sum[kGradient + i];
  }
};

bool solve(const double a[21], const double b[6], double x[6]) {
  double upper[21], minus_b[6];
  std::copy_n(a, 21, upper);
  for (int32_t i = 0, k = 0; i < 6; k += 6 - i, ++i) {
    upper[k] += kSlack;
    minus_b[i] = -b[i];
  }
  Cholesky6 cholesky;
  if (!cholesky.factor(upper, 0.0)) return false;
  cholesky.solve(minus_b, x);
  return true;
}

/// x^T A x
double quadratic(const double a[21], const double x[6]) {
  double sum = 0;
  for (int32_t r = 0, k = 0; r < 6; ++r)
    for (int32_t c = r; c < 6; ++c, ++k) sum += (r == c ? 1.0 : 2.0) * a[k] * x[r] * x[c];
  return sum;
}

/// Enough of it is known for a motion of its own.
bool votes(const Part& part) {
  return part.motion.sum[kPoints] >= kMinPoints;
}

/// Median over the area of how far parts lie off, in units of what they may.
float usual_offset(int32_t parts, const PartMemory& memory, const MaskParams& params) {
  constexpr int32_t kBins = 64;
  constexpr double kBinsPerUnit = 16.0;
  double area[kBins] = {}, all = 0;
  for (int32_t i = 0; i < parts; ++i) {
    const Part& part = memory.parts[static_cast<uint32_t>(i)];
    if (!votes(part)) continue;
    const double off = static_cast<double>(part.moved_m / may_move_m(part, params));
    area[std::min(kBins - 1, static_cast<int32_t>(off * kBinsPerUnit))] += static_cast<double>(part.area_m2);
    all += static_cast<double>(part.area_m2);
  }
  double below = 0;
  for (int32_t bin = 0; bin < kBins; ++bin) {
    below += area[bin];
    if (2.0 * below >= all) return params.moved_usual * static_cast<float>((bin + 0.5) / kBinsPerUnit);
  }
  return 0.0f;
}

bool has_moved(const Part& part, const MaskParams& params, float usual) {
  return params.moved_m > 0.0f && part.area_m2 >= params.moved_m2 && part.near_map &&
         part.moved_m > may_move_m(part, params) * usual;
}

/// Share of the area that follows another motion than most of it: with half or more nothing was agreed on.
float moved_share(int32_t parts, const PartMemory& memory, const MaskParams& params, float usual) {
  float moved = 0, all = 0;
  for (int32_t i = 0; i < parts; ++i) {
    const Part& part = memory.parts[static_cast<uint32_t>(i)];
    all += part.area_m2;
    if (has_moved(part, params, usual)) moved += part.area_m2;
  }
  return all > 0.0f ? moved / all : 0.0f;
}

}  // namespace

Twistd agree_on_motion(int32_t parts, const PartMemory& memory, const MaskParams& params, float& usual) {
  constexpr int32_t kRounds = 8;
  const float usual_before = usual;
  double motion[6] = {};
  for (int32_t round = 0; round < kRounds; ++round) {
    double a[21] = {}, b[6] = {};
    for (int32_t i = 0; i < parts; ++i) {
      const Part& part = memory.parts[static_cast<uint32_t>(i)];
      if (!votes(part)) continue;
      // At first the area alone, then what follows another motion loses its say.
      const double off = static_cast<double>(part.moved_m / (may_move_m(part, params) * usual_before));
      const double trust = 1.0 / (1.0 + off * off);
      const double weight = static_cast<double>(part.area_m2) * trust * trust;
      const PartSystem system(part.motion);
      for (int32_t k = 0; k < 21; ++k) a[k] += weight * system.a[k];
      for (int32_t k = 0; k < 6; ++k) b[k] += weight * system.b[k];
    }
    if (!solve(a, b, motion)) return {};
    for (int32_t i = 0; i < parts; ++i) {
      Part& part = memory.parts[static_cast<uint32_t>(i)];
      if (!votes(part)) continue;
      const PartSystem system(part.motion);
      double own[6];
      if (!solve(system.a, system.b, own)) continue;
      for (int32_t k = 0; k < 6; ++k) own[k] -= motion[k];
      part.moved_m = static_cast<float>(std::sqrt(std::max(0.0, quadratic(system.a, own))));
    }
  }
  usual = std::max(usual_offset(parts, memory, params), 1.0f + (usual - 1.0f) * 0.99f);
  return {{motion[0], motion[1], motion[2]}, {motion[3], motion[4], motion[5]}};
}

namespace {

/// By the last mask.
bool was_dynamic(const Part& part, const MaskParams& params) {
  return params.warp && 2 * part.expected > part.cells;
}
/// The usual offset beyond which it is off its place.
float usual_for(const Part& part, const MaskParams& params, float usual) {
  return was_dynamic(part, params) ? kStillMovesShare * usual : usual;
}

}  // namespace

bool needs_slide(const Part& part, const CellGrid& cells, const MaskParams& params, float usual) {
  const float off = usual_for(part, params, usual);
  return !stands(part) && has_moved(part, params, off) &&
         part.moved_m <= may_move_m(part, params) * off + cells.drift_m;
}

namespace {

/// What stands still is static, though it contradicts the map or lies off it: the map will learn it.
void decide(Part& part, const CellGrid& cells, const MaskParams& params, float usual, bool believe_moves) {
  const bool was = was_dynamic(part, params);
  const bool hardly_known = part.known < kHardlyKnownShare * static_cast<float>(part.cells);
  const float share = part.known > 0 ? part.contradicts / part.known : 0.0f;
  const float limit = was && !hardly_known ? params.share_off : params.share_on;
  const bool contradicts = part.contradicts_m2 >= params.blob_m2 && share > limit;
  const bool stood = stands(part);
  const bool slid = part.slid_m > kSlidShare * may_move_m(part, params);
  const bool seems_moved = !stood && believe_moves &&
                           has_moved(part, params, usual_for(part, params, usual)) &&
                           (slid || !needs_slide(part, cells, params, usual));
  // Noise, or the other side of a thin thing, lies off for one frame: what moves does so in the next one too.
  const bool twice = !params.warp || 2 * part.expected_or_doubted > part.cells;
  part.moved = seems_moved && twice;
  part.doubted = seems_moved && !twice;
  // Where the map cannot tell, what was in the mask stays in it; but a surface that comes out from behind a
  // mover only touched it, and starts small.
  const bool goes_on =
      params.warp && hardly_known && 2 * part.expected_inside > part.cells && part.area_m2 >= params.blob_m2;
  part.dynamic = part.moved || (!stood && (contradicts || goes_on));
}

}  // namespace

void decide_parts(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                  float usual) {
  std::fill_n(cells.dynamic.data, cells.dynamic.pixels(), uint8_t{0});
  const bool believe_moves = moved_share(parts, memory, params, usual) < kMostOfTheSpace;
  for (int32_t i = 0; i < parts; ++i) {
    Part& part = memory.parts[static_cast<uint32_t>(i)];
    decide(part, cells, params, usual, believe_moves);
  }
  const auto part_of = [&](int32_t r, int32_t c) -> const Part& {
    return memory.parts[static_cast<uint32_t>(cells.part.at(r, c))];
  };
  for (int32_t r = 0; r < cells.part.rows; ++r)
    for (int32_t c = 0; c < cells.part.cols; ++c) {
      if (cells.part.at(r, c) < 0) continue;
      if (part_of(r, c).dynamic)
        cells.dynamic.at(r, c) = memory.border.at(r, c) ? kTouched : kSet;
      else if (part_of(r, c).doubted)
        cells.dynamic.at(r, c) = kDoubted;
    }
  // A thing that was put down makes one part with what it stands on, or with who put it there: what the map
  // knows well stays static, and so does what has settled.
  set_blobs(cells, memory, params.moved_m2, 0, [&](int32_t r, int32_t c) {
    if (cells.part.at(r, c) < 0 || !is_dynamic(cells.dynamic.at(r, c))) return false;
    const Contradiction evidence = cells.evidence.at(r, c);
    return !part_of(r, c).moved && ((evidence >= 0.0f && evidence < kContradicts) || settled(cells, r, c));
  });
  // Of a part that stands, half the time will do: noise has started the count of some of its cells again.
  set_blobs(cells, memory, params.blob_m2, kSet, [&](int32_t r, int32_t c) {
    if (cells.evidence.at(r, c) < 1.0f || settled(cells, r, c)) return false;
    const bool with_what_stands = cells.part.at(r, c) >= 0 && stands(part_of(r, c));
    return !with_what_stands || 2 * cells.still.at(r, c) < cells.settled_frames;
  });
  grow(cells, memory, params.grow_m);
}

void carry_mask(const ImageView<const float>& depth_before_m, const ImageView<const uint8_t>& dynamic_before,
                const Se3& T_now_before, const CellGrid& now) {
  std::fill_n(now.expected.data, now.expected.pixels(), uint8_t{0});
  const CarryMaskPass pass{depth_before_m, dynamic_before, T_now_before, now};
  for (int32_t r = 0; r < depth_before_m.rows; ++r)
    for (int32_t c = 0; c < depth_before_m.cols; ++c)
      pass(r, c, [&](int32_t row, int32_t col, uint8_t dynamic) {
        now.expected.at(row, col) = std::max(now.expected.at(row, col), dynamic);
      });
}

}  // namespace stillmap
