#include "kernels/relocalise/align_pass.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/corner_scene.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

/// A model of the corner from the origin, and what a camera elsewhere sees.
struct Alignment {
  Intrinsics k = corner_camera(80);
  CornerView model_view{CornerScene{}, k, {}};
  std::vector<Vec3> normals = std::vector<Vec3>(80 * 60);
  ModelView model{k, {}, {model_view.depth_m.data(), 60, 80, 80}, {normals.data(), 60, 80, 80}};
  CornerView seen;
  std::vector<float> luma;
  SmallView view;

  explicit Alignment(const Se3d& T_map_cam) : seen(CornerScene{}, k, T_map_cam) {
    for (const LumaChroma& c : seen.luma) luma.push_back(static_cast<float>(c.luma) / kLumaScale);
    view = {{seen.depth_m.data(), 60, 80, 80}, {luma.data(), 60, 80, 80}};
    const NormalPass pass{model};
    for (int32_t r = 0; r < 60; ++r)
      for (int32_t c = 0; c < 80; ++c) pass(r, c);
  }
  template <class Pass>
  AlignSums sum(const Pass& pass) const {
    AlignSums sums;
    for (int32_t r = 0; r < 60; ++r)
      for (int32_t c = 0; c < 80; ++c) pass(r, c, sums);
    return sums;
  }
};

/// Gauss-Newton with the sums of `sums_at`.
template <class Sums>
Se3d solved(Se3d T, int iterations, const Sums& sums_at) {
  for (int i = 0; i < iterations; ++i) {
    const AlignSums sums = sums_at(cast<float>(T));
    Cholesky6 cholesky;
    EXPECT_TRUE(cholesky.factor(sums.eq.sum + kHessian, 1e-6));
    double x[6];
    cholesky.solve(sums.eq.sum + kGradient, x);
    T = {exp(Twistd{{}, {-x[3], -x[4], -x[5]}}).rotation * T.rotation,
         T.translation - Vec3d{x[0], x[1], x[2]}};
  }
  return T;
}

double degrees_off(const Se3d& a, const Se3d& b) {
  return 57.2957795 * norm(log_rotation(transposed(a.rotation) * b.rotation));
}

TEST(Align, NormalsAreThoseOfTheWallsAndLookAtTheCamera) {
  const Alignment a{Se3d{}};
  int32_t walls = 0, known = 0;
  for (const Vec3 n : a.normals) {
    if (dot(n, n) < 0.5f) continue;
    ++known;
    walls += n.x < -0.999f || n.y < -0.999f || n.z < -0.999f;
  }
  EXPECT_GT(known, 4000);
  EXPECT_GT(walls, known * 9 / 10);  // but for the edges
}

TEST(Align, AgainstAViewOfTheMapFromTwentyDegreesAndThirtyCentimetres) {
  const Se3d truth = exp(Twistd{{0.2, -0.1, 0.2}, {0.1, 0.33, -0.08}});
  const Alignment a(truth);
  Se3d T;
  for (const float gate_m : {0.4f, 0.2f, 0.1f})
    T = solved(T, 8, [&](const Se3& T_map_cam) {
      return a.sum(ModelAlignPass{a.view, a.k, a.model, T_map_cam, gate_m});
    });
  EXPECT_LT(norm(T.translation - truth.translation), 0.01);
  EXPECT_LT(degrees_off(T, truth), 0.5);
}

TEST(Align, AgainstTheMapFromTheRestOfTheWay) {
  const Se3d truth = exp(Twistd{{0.1, -0.1, 0.1}, {0.05, 0.1, -0.05}});
  const Alignment a(truth);
  AnalyticMap map = test::corner_map(CornerScene{}, 0.02f, 0.1f);
  const Se3d start = exp(Twistd{{0.02, 0.02, -0.03}, {0.01, -0.01, 0.01}}) * truth;
  const Se3d T = solved(start, 8, [&](const Se3& T_map_cam) {
    const MapAlignPass pass{map.view(), a.view, a.k, T_map_cam, 0.08f, 0.025f, 1.0f};
    BlockCache cache;
    return a.sum([&](int32_t r, int32_t c, AlignSums& s) { pass(r, c, cache, s); });
  });
  EXPECT_LT(norm(T.translation - truth.translation), 0.003);
  EXPECT_LT(degrees_off(T, truth), 0.1);
}

TEST(Align, FarPlanesAreSomethingElse) {
  const Alignment a{Se3d{}};
  Se3 T;
  T.translation = {0, 0, 0.5f};
  EXPECT_EQ(tukey(0.3f, 0.2f), 0.0f);
  EXPECT_EQ(tukey(0.0f, 0.2f), 1.0f);
  const AlignSums near_by = a.sum(ModelAlignPass{a.view, a.k, a.model, {}, 0.2f});
  const AlignSums far = a.sum(ModelAlignPass{a.view, a.k, a.model, T, 0.2f});
  EXPECT_GT(near_by.eq.sum[kInliers], 4000);
  EXPECT_LT(far.eq.sum[kInliers], near_by.eq.sum[kInliers] * 0.7);
}

}  // namespace
}  // namespace stillmap
