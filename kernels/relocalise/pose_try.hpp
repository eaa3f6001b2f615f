#pragma once

// The rules by which a try is followed from a keyframe's pose to its end, the same for both engines.

#include <cstdint>

#include "kernels/engine.hpp"
#include "kernels/relocalise/align_pass.hpp"
#include "kernels/relocalise/view_check.hpp"

namespace stillmap {

/// Where a search begins and, when it was followed, where it ended.
struct PoseTry {
  Se3 T_map_cam;
  ViewCheck check;
};

/// One alignment to a view of the map: gate, steps. The view is made anew before the third.
struct ModelAlignment {
  float gate_m;
  int32_t steps;
};
STILLMAP_HD ModelAlignment model_alignment(int32_t i) {
  return i == 0 ? ModelAlignment{0.4f, 6} : i == 3 ? ModelAlignment{0.1f, 4} : ModelAlignment{0.2f, 4};
}
constexpr int32_t kModelAlignments = 4;
constexpr int32_t kNewViewBefore = 2;
constexpr double kLeastOnModel = 0.15;  ///< share of the cells of the coarser view

constexpr int32_t kMapSteps = 8;
constexpr double kLeastOnMap = 0.1;  ///< share of the cells of the finer view
constexpr float kMapGate_m = 0.08f, kNarrowMapGate_m = 0.04f;
constexpr float kMapColourWeight = 0.025f;
constexpr float kModelMargin = 0.2f;  ///< by which a view of the map is wider than the frame, on each side

STILLMAP_HD Intrinsics widened(const Intrinsics& k) {
  const int32_t x = static_cast<int32_t>(kModelMargin * static_cast<float>(k.width));
  const int32_t y = static_cast<int32_t>(kModelMargin * static_cast<float>(k.height));
  return {k.fx,
          k.fy,
          k.cx + static_cast<float>(x),
          k.cy + static_cast<float>(y),
          k.width + 2 * x,
          k.height + 2 * y};
}

/// Gauss-Newton step about the camera centre. @return false when the system is singular
STILLMAP_HD bool align_step(const NormalEq& sums, Se3& T_map_cam) {
  constexpr double kDamping = 1e-3;
  Cholesky6 cholesky;
  if (!cholesky.factor(sums.sum + kHessian, kDamping)) return false;
  double x[6];
  cholesky.solve(sums.sum + kGradient, x);
  for (const double value : x)
    if (!(value - value == 0.0)) return false;  // not finite
  const Se3d turn = exp(Twistd{{}, {-x[3], -x[4], -x[5]}});
  const Se3d T = cast<double>(T_map_cam);
  T_map_cam =
      cast<float>(Se3d{orthonormalized(turn.rotation * T.rotation), T.translation - Vec3d{x[0], x[1], x[2]}});
  return true;
}

/// Standard deviation of the worst direction for 1 cm of noise in each of the points, all of them pulling the
/// same way: what the geometry binds, whatever the number of points.
STILLMAP_HD float weakest_direction_m(const NormalEq& sums) {
  constexpr float kUnbound_m = 1e3f, kNoise_m = 0.01f;
  constexpr double kTypicalArm_m = 2.0;  // from the camera to what it sees
  Cholesky6 cholesky;
  if (sums.sum[kInliers] < 1 || !cholesky.factor(sums.sum + kHessian, 0.0)) return kUnbound_m;
  double worst = 0;
  for (int32_t i = 0; i < 6; ++i) {
    double unit[6] = {}, x[6];
    unit[i] = 1;
    cholesky.solve(unit, x);
    const double arm_m = i < 3 ? 1.0 : kTypicalArm_m, scaled = x[i] * arm_m * arm_m;
    worst = scaled > worst ? scaled : worst;
  }
  return kNoise_m * static_cast<float>(sqrt(worst * sums.sum[kInliers]));
}

/// How many cells say what, by CellVerdict.
struct VerdictCounts {
  uint32_t count[5] = {};

  STILLMAP_HD friend VerdictCounts operator+(const VerdictCounts& a, const VerdictCounts& b) {
    VerdictCounts sum;
    for (int32_t i = 0; i < 5; ++i) sum.count[i] = a.count[i] + b.count[i];
    return sum;
  }
  STILLMAP_HD int32_t cells() const {
    uint32_t say = 0;
    for (const uint32_t n : count) say += n;
    return static_cast<int32_t>(say - count[static_cast<int32_t>(CellVerdict::none)]);
  }
  STILLMAP_HD float share(CellVerdict verdict) const {
    const int32_t all = cells();
    return static_cast<float>(count[static_cast<int32_t>(verdict)]) / static_cast<float>(all > 1 ? all : 1);
  }
};
STILLMAP_HD void write_shares(const VerdictCounts& counts, ViewCheck& check) {
  check.cells = counts.cells();
  check.on = counts.share(CellVerdict::on);
  check.front = counts.share(CellVerdict::front);
  check.through = counts.share(CellVerdict::through);
  check.unknown = counts.share(CellVerdict::unknown);
}

/// Most wrong poses fail by their luminances, which cost little; only the others are held against the view
/// that the map promises.
STILLMAP_HD bool worth_a_view(const ViewCheck& check, const RelocaliseParams& p) {
  return check.on >= p.min_on && check.luma_correlation >= p.min_luma_correlation &&
         check.texture_correlation >= p.min_texture_correlation;
}

/// Correlation of two numbers from their sums.
struct Correlation {
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;

  STILLMAP_HD void add(float x, float y) {
    const double p = static_cast<double>(x), q = static_cast<double>(y);
    n += 1;
    a += p;
    b += q;
    aa += p * p;
    bb += q * q;
    ab += p * q;
  }
  STILLMAP_HD float value() const {
    const double va = n * aa - a * a, vb = n * bb - b * b;
    return va > 0 && vb > 0 ? static_cast<float>((n * ab - a * b) / sqrt(va * vb)) : 0.0f;
  }
  STILLMAP_HD friend Correlation operator+(const Correlation& x, const Correlation& y) {
    return {x.n + y.n, x.a + y.a, x.b + y.b, x.aa + y.aa, x.bb + y.bb, x.ab + y.ab};
  }
};

/// Of measured and mapped luminance over the cells on the map, and of their steps from cell to cell.
struct LumaCorrelation {
  Correlation luma, texture;

  STILLMAP_HD void add(const ImageView<float>& measured, const ImageView<float>& mapped, int32_t r,
                       int32_t c) {
    if (!usable(measured, mapped, r, c)) return;
    const float here = measured.at(r, c), there = mapped.at(r, c);
    luma.add(here, there);
    if (usable(measured, mapped, r, c + 1))
      texture.add(measured.at(r, c + 1) - here, mapped.at(r, c + 1) - there);
    if (usable(measured, mapped, r + 1, c))
      texture.add(measured.at(r + 1, c) - here, mapped.at(r + 1, c) - there);
  }
  STILLMAP_HD friend LumaCorrelation operator+(const LumaCorrelation& x, const LumaCorrelation& y) {
    return {x.luma + y.luma, x.texture + y.texture};
  }

 private:
  STILLMAP_HD static bool usable(const ImageView<float>& measured, const ImageView<float>& mapped, int32_t r,
                                 int32_t c) {
    return r < measured.rows && c < measured.cols && mapped.at(r, c) != kNoLuma &&
           measured.at(r, c) != kNoLuma;
  }
};

}  // namespace stillmap
