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

/// One cell against the earlier frame: its surface along the normal, its brightness along the picture.
void add_cell(const CellGrid& cells, int32_t r, int32_t c, const EarlierCells& earlier,
              const Se3& T_earlier_now, const DepthNoise& noise, Slide& slide) {
  const Vec3 p = T_earlier_now * cells.point(r, c);
  if (p.z < kNearestM) return;
  const Pixel at = project(cells.k, p);
  const int32_t er = static_cast<int32_t>(std::floor(at.v + 0.5f)),
                ec = static_cast<int32_t>(std::floor(at.u + 0.5f));
  if (!earlier.depth_m.contains(er, ec) || std::fabs(earlier.depth_m.at(er, ec) - p.z) > depth_edge_m(p.z))
    return;
  const Vec3 was =
      unproject(cells.k, static_cast<float>(ec), static_cast<float>(er), earlier.depth_m.at(er, ec));
  const Vec3 n = T_earlier_now.rotation * cells.normal.at(r, c);
  if (dot(n, n) > 0.5f) slide.add(n, dot(n, p - was), noise.at(p.z));
  const LumaAt luma = luma_at(earlier, at, p.z);
  if (!luma.known) return;
  const float u = cells.k.fx * luma.across / p.z, v = cells.k.fy * luma.down / p.z;
  const Vec3 gradient = {u, v, -(u * p.x + v * p.y) / p.z};
  slide.add(gradient, luma.value - cells.luma.at(r, c) * (1.0f / kLumaScale), kLumaSigma);
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

}  // namespace stillmap
