#include "kernels/mask/slide.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

constexpr float kLumaSigma = 0.02f;    ///< of a cell, white is 1
constexpr float kRobustSigmas = 4.0f;  ///< what lies farther off has no pull
constexpr double kSlackM =
    0.1f;  ///< sigma of a slide before anything is seen: keeps what a part does not show at rest

/// Linear between four cells of one surface, with its slope a cell.
struct LumaAt {
  float value, across, down;
  bool known;
};

LumaAt luma_at(const EarlierCells& earlier, Pixel at, float z_m) {
  const float c0 = std::floor(at.u), r0 = std::floor(at.v), x = at.u - c0, y = at.v - r0;
  const int32_t r = static_cast<int32_t>(r0), c = static_cast<int32_t>(c0);
  if (!earlier.luma.contains(r, c) || !earlier.luma.contains(r + 1, c + 1)) return {};
  float luma[4];
  for (int32_t i = 0; i < 4; ++i) {
    const int32_t nr = r + (i >> 1), nc = c + (i & 1);
    if (std::fabs(earlier.depth_m.at(nr, nc) - z_m) > depth_edge_m(z_m)) return {};
    luma[i] = earlier.luma.at(nr, nc) * (1.0f / kLumaScale);
  }
  const float top = luma[0] + x * (luma[1] - luma[0]), bottom = luma[2] + x * (luma[3] - luma[2]);
  const float across = (1.0f - y) * (luma[1] - luma[0]) + y * (luma[3] - luma[2]);
  return {top + y * (bottom - top), across, bottom - top, true};
}

/// Least squares of a translation: (A + slack) x = b.
struct Slide {
  double a[6] = {};  ///< upper triangle, row by row
  Vec3d b;

  /// Adds one equation g x = r with a standard deviation; robust.
  void add(Vec3 gradient, float r, float sigma) {
    const float error = r / (kRobustSigmas * sigma), trust = 1.0f / (1.0f + error * error);
    const double w = static_cast<double>(trust * trust / (sigma * sigma));
    const Vec3d g = {static_cast<double>(gradient.x), static_cast<double>(gradient.y),
                     static_cast<double>(gradient.z)};
    const double upper[6] = {g.x * g.x, g.x * g.y, g.x * g.z, g.y * g.y, g.y * g.z, g.z * g.z};
    for (int32_t i = 0; i < 6; ++i) a[i] += w * upper[i];
    b = b + (w * static_cast<double>(r)) * g;
  }
  float solved_m() const {
    constexpr double kSlack = 1.0 / (kSlackM * kSlackM);
    const Vec3d c0 = {a[0] + kSlack, a[1], a[2]}, c1 = {a[1], a[3] + kSlack, a[4]},
                c2 = {a[2], a[4], a[5] + kSlack};
    const Vec3d n = cross(c1, c2);
    const Vec3d x = {dot(b, n), dot(b, cross(c2, c0)), dot(b, cross(c0, c1))};
    return static_cast<float>(norm(x) / dot(c0, n));
  }
};

/// Where a cell would be in an earlier frame, and what that frame saw there.
struct Sight {
  Vec3 p, was;  ///< camera of the earlier frame, metres
  Pixel at;
};

/// @return false: that place was out of view, or not measured
bool look_back(const CellGrid& cells, int32_t r, int32_t c, const EarlierCells& earlier,
               const Se3& T_earlier_now, Sight& sight) {
  sight.p = T_earlier_now * cells.point(r, c);
  if (sight.p.z < kNearestM) return false;
  sight.at = project(cells.k, sight.p);
  const int32_t er = static_cast<int32_t>(std::floor(sight.at.v + 0.5f)),
                ec = static_cast<int32_t>(std::floor(sight.at.u + 0.5f));
  if (!earlier.depth_m.contains(er, ec) || earlier.depth_m.at(er, ec) <= 0.0f) return false;
  sight.was = unproject(cells.k, static_cast<float>(ec), static_cast<float>(er), earlier.depth_m.at(er, ec));
  return true;
}

/// Of the brightness that the earlier frame shows, by the point.
Vec3 gradient_of(const LumaAt& luma, const CellGrid& cells, Vec3 p) {
  const float u = cells.k.fx * luma.across / p.z, v = cells.k.fy * luma.down / p.z;
  return {u, v, -(u * p.x + v * p.y) / p.z};
}

/// One cell against the earlier frame: its surface along the normal, its brightness along the picture.
void add_cell(const CellGrid& cells, int32_t r, int32_t c, const EarlierCells& earlier,
              const Se3& T_earlier_now, const DepthNoise& noise, Slide& slide) {
  Sight sight;
  if (!look_back(cells, r, c, earlier, T_earlier_now, sight)) return;
  const Vec3 p = sight.p;
  if (std::fabs(sight.was.z - p.z) > depth_edge_m(p.z)) return;
  const Vec3 n = T_earlier_now.rotation * cells.normal.at(r, c);
  if (dot(n, n) > 0.5f) slide.add(n, dot(n, p - sight.was), noise.at(p.z));
  const LumaAt luma = luma_at(earlier, sight.at, p.z);
  if (!luma.known) return;
  slide.add(gradient_of(luma, cells, p), luma.value - cells.luma.at(r, c) * (1.0f / kLumaScale), kLumaSigma);
}

// The least squares above see no farther than the pattern is smooth: what slid by more than the width of a
// stripe seems to have stayed, with a few cells that do not fit. Then some of them are tried at other places.
constexpr int32_t kFarthestCells = 8, kShiftCells = 2;  ///< places tried, along the picture
constexpr int32_t kMostAsked = 400;                     ///< cells of a part, every so manieth of it
constexpr float kMisfitLuma = 0.04f;                    ///< where half of a misfit is reached
constexpr float kBetterShare = 0.75f;                   ///< of the misfit in place is left elsewhere
constexpr float kBetterCells = 8.0f;                    ///< that fit elsewhere and not in place

/// Cells of a part, where they would be in an earlier frame had they stayed.
struct AskedCells {
  struct Cell {
    Pixel at;
    float z_m, luma;
  } cell[kMostAsked];
  int32_t count = 0;
};

void ask_cells(const CellGrid& cells, int32_t i, const Part& part, const Se3& T_earlier_now,
               AskedCells& asked) {
  const int32_t every = 1 + part.cells / kMostAsked;
  int32_t met = 0;
  for_cells_of(cells, i, part, [&](int32_t r, int32_t c) {
    if (met++ % every != 0 || asked.count == kMostAsked) return;
    const Vec3 p = T_earlier_now * cells.point(r, c);
    if (p.z < kNearestM) return;
    asked.cell[asked.count++] = {project(cells.k, p), p.z, cells.luma.at(r, c) * (1.0f / kLumaScale)};
  });
}

/// Cells whose brightness the earlier frame does not show, 0 to 1 each.
struct Misfit {
  float sum = 0, cells = 0;
  float mean() const { return sum / std::max(cells, 1.0f); }
};

/// @param right, down where the cells are looked for, from where they would be, in cells
Misfit misfit_at(const AskedCells& asked, const EarlierCells& earlier, int32_t right, int32_t down) {
  Misfit misfit;
  for (int32_t i = 0; i < asked.count; ++i) {
    const AskedCells::Cell& cell = asked.cell[i];
    const Pixel there = {cell.at.u + static_cast<float>(right), cell.at.v + static_cast<float>(down)};
    const LumaAt luma = luma_at(earlier, there, cell.z_m);
    if (!luma.known) continue;
    const float error = (luma.value - cell.luma) / kMisfitLuma;
    misfit.sum += error * error / (1.0f + error * error);
    misfit.cells += 1.0f;
  }
  return misfit;
}

bool fits_elsewhere(const CellGrid& cells, int32_t i, const Part& part, const EarlierCells& earlier,
                    const Se3& T_earlier_now) {
  AskedCells asked;
  ask_cells(cells, i, part, T_earlier_now, asked);
  const Misfit here = misfit_at(asked, earlier, 0, 0);
  if (here.sum < kBetterCells) return false;
  for (int32_t down = -kFarthestCells; down <= kFarthestCells; down += kShiftCells)
    for (int32_t right = -kFarthestCells; right <= kFarthestCells; right += kShiftCells) {
      const Misfit there = misfit_at(asked, earlier, right, down);
      if (2.0f * there.cells > here.cells && there.mean() < kBetterShare * here.mean() &&
          (here.mean() - there.mean()) * here.cells > kBetterCells)
        return true;
    }
  return false;
}

}  // namespace

void restart_sliding(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                     const DepthNoise& noise, const EarlierCells& earlier, const Se3& T_earlier_now,
                     int32_t frames) {
  const int32_t most = std::max(0, std::min(frames, cells.settled_frames - 1));
  for (int32_t i = 0; i < parts; ++i) {
    Part& part = memory.parts[static_cast<uint32_t>(i)];
    const bool fits = part.contradicts_m2 < params.blob_m2 && part.moved_m <= may_move_m(part, params);
    if (part.settled == 0 || fits) continue;
    Slide slide;
    for_cells_of(cells, i, part,
                 [&](int32_t r, int32_t c) { add_cell(cells, r, c, earlier, T_earlier_now, noise, slide); });
    if (slide.solved_m() <= may_move_m(part, params) &&
        !fits_elsewhere(cells, i, part, earlier, T_earlier_now))
      continue;
    for_cells_of(cells, i, part, [&](int32_t r, int32_t c) {
      cells.still.at(r, c) = std::min(cells.still.at(r, c), static_cast<uint16_t>(most));
    });
    part.settled = 0;
  }
}

void restart_sliding(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                     const DepthNoise& noise, const EarlierFrames& earlier, const Se3& T_map_now) {
  int32_t frames = 0;
  for (int32_t later = kEarlier - 1; later > 0; --later) {
    const EarlierCells& then = earlier.at(later);
    restart_sliding(cells, parts, memory, params, noise, then, inverse(then.T_map_cam) * T_map_now, frames);
    frames = earlier.age(later);
  }
}

namespace {

constexpr float kMisplacedM = 0.02f;    ///< without noise: what lies farther off hardly pulls
constexpr float kColourWeight = 0.05f;  ///< w_c of the paper
constexpr float kFarM = 1.0f;           ///< slide of what is where nothing was

/// A cell against an earlier frame, as CellEvidencePass compares it with the map.
CellResidual residual_since(const CellGrid& cells, int32_t r, int32_t c, const EarlierCells& earlier,
                            const Se3& T_earlier_now, const DepthNoise& noise, const Sight& sight) {
  CellResidual residual = {};
  PointTerms<float>& terms = residual.terms;
  residual.arm = sight.p - T_earlier_now.translation;
  terms.depth_gradient = T_earlier_now.rotation * cells.normal.at(r, c);
  terms.depth_residual_m = dot(terms.depth_gradient, sight.p - sight.was);
  const float scale_m = kMisplacedM + kRobustSigmas * noise.at(sight.p.z);
  terms.depth_weight = geman_mcclure(terms.depth_residual_m * terms.depth_residual_m, scale_m).weight;
  const LumaAt luma = luma_at(earlier, sight.at, sight.p.z);
  if (!luma.known) return residual;
  terms.colour_gradient = gradient_of(luma, cells, sight.p);
  terms.colour_residual = luma.value - cells.luma.at(r, c) * (1.0f / kLumaScale);
  terms.colour_weight = kColourWeight * terms.depth_weight;
  return residual;
}

void add_cell_since(const CellGrid& cells, int32_t r, int32_t c, const EarlierCells& earlier,
                    const Se3& T_earlier_now, const DepthNoise& noise, Part& part) {
  Sight sight;
  if (!look_back(cells, r, c, earlier, T_earlier_now, sight)) return;
  const float edge_m = depth_edge_m(sight.p.z);
  if (sight.was.z < sight.p.z - edge_m) return;  // something was before it
  if (sight.was.z > sight.p.z + edge_m) {
    ++part.came;
    return;
  }
  ++part.there;
  if (!(dot(cells.normal.at(r, c), cells.normal.at(r, c)) > 0.5f)) return;
  const CellResidual residual = residual_since(cells, r, c, earlier, T_earlier_now, noise, sight);
  NormalEqT<float> sums;
  add_point(residual.terms, residual.arm, 1.0f, 1.0f, sums.sum);
  part.motion.add(sums);
}

/// @return how far a part lies off its place in the earlier frame that was added; < 0: too little of it was
/// seen
float slide_since(const Part& part) {
  if (2 * (part.there + part.came) < part.cells) return -1.0f;
  return part.came > part.there ? kFarM : part.moved_m;
}

/// Of those that are known; 0: none is. One frame alone may have been matched badly.
float second_largest(const float (&slides_m)[kEarlier - 1]) {
  float most_m = -1.0f, second_m = -1.0f;
  for (const float slide_m : slides_m) {
    second_m = std::max(second_m, std::min(most_m, slide_m));
    most_m = std::max(most_m, slide_m);
  }
  return std::max(second_m >= 0.0f ? second_m : most_m, 0.0f);
}

}  // namespace

void measure_slides(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                    const DepthNoise& noise, const EarlierFrames& earlier, const Se3& T_map_now,
                    float usual) {
  const View<Part> all = {memory.parts.data, static_cast<uint32_t>(parts)};
  if (std::none_of(all.begin(), all.end(),
                   [&](const Part& part) { return needs_slide(part, cells, params, usual); }))
    return;
  for (Part& part : all) part.slid_m = part.moved_m;  // kept there meanwhile
  for (int32_t later = 1; later < kEarlier; ++later) {
    for (Part& part : all) {
      part.motion = {};
      part.there = part.came = 0;
      part.moved_m = 0;
    }
    const EarlierCells& then = earlier.at(later);
    const Se3 T_then_now = inverse(then.T_map_cam) * T_map_now;
    for (int32_t r = 0; r < cells.part.rows; ++r)
      for (int32_t c = 0; c < cells.part.cols; ++c)
        if (const int32_t i = cells.part.at(r, c); i >= 0)
          add_cell_since(cells, r, c, then, T_then_now, noise, all[static_cast<uint32_t>(i)]);
    float usual_since = 1.0f;
    agree_on_motion(parts, memory, params, usual_since);
    for (Part& part : all) part.slides_m[later - 1] = slide_since(part);
  }
  for (Part& part : all) {
    part.moved_m = part.slid_m;
    part.slid_m = second_largest(part.slides_m);
  }
}

}  // namespace stillmap
