#include "kernels/relocalise/view_check.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/corner_scene.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

/// What each cell of a view of `scene` says of a map of the bare corner, at the origin.
struct Verdicts {
  int32_t count[5] = {};
  int32_t of(CellVerdict v) const { return count[static_cast<int32_t>(v)]; }

  explicit Verdicts(const CornerScene& scene, const Se3& T_map_cam = {}) {
    const CornerScene corner;
    const AnalyticMap map = test::corner_map(corner, 0.02f, 0.1f);
    const Intrinsics k = corner_camera(80);
    CornerView measured(scene, k, {});
    const CornerView expected(corner, k, cast<double>(T_map_cam));
    std::vector<float> luma(measured.depth_m.size(), 0.5f), map_luma(luma.size());
    const ViewCheckPass pass{
        map.view(),
        {{measured.depth_m.data(), k.height, k.width, k.width}, {luma.data(), k.height, k.width, k.width}},
        k,
        T_map_cam,
        expected.image(expected.depth_m),
        {map_luma.data(), k.height, k.width, k.width}};
    BlockCache cache;
    for (int32_t r = 0; r < k.height; ++r)
      for (int32_t c = 0; c < k.width; ++c) {
        const CellVerdict v = pass(r, c, cache);
        ++count[static_cast<int32_t>(v)];
        const float mapped = map_luma[static_cast<size_t>(r * k.width + c)];
        EXPECT_EQ(v == CellVerdict::on, mapped != kNoLuma);
        if (v == CellVerdict::on) {
          EXPECT_TRUE(mapped > 0.0f && mapped < 1.0f);
        }
      }
  }
};
constexpr int32_t kCells = 80 * 60;

TEST(ViewCheck, AtTheTruePoseEverythingLiesOnTheMap) {
  EXPECT_GT(Verdicts(CornerScene{}).of(CellVerdict::on), kCells * 97 / 100);
}

TEST(ViewCheck, SomeoneBeforeTheWallStandsInFront) {
  CornerScene scene;
  scene.box = {{-0.25, -0.2, 1.0}, {0.25, 0.2, 1.06}};
  const Verdicts v(scene);
  EXPECT_GT(v.of(CellVerdict::front), kCells / 10);
  EXPECT_GT(v.of(CellVerdict::on), kCells / 2);
  EXPECT_EQ(v.of(CellVerdict::through), 0);
}

TEST(ViewCheck, AWallThatIsSeenThroughContradicts) {
  CornerScene scene;
  scene.back_z = 2.5;
  const Verdicts v(scene);
  EXPECT_GT(v.of(CellVerdict::through), kCells / 10);
  EXPECT_EQ(v.of(CellVerdict::front), 0);
}

TEST(ViewCheck, AWrongPoseContradictsInBothWays) {
  Se3 T;
  T.translation = {0.0f, 0.0f, 0.15f};
  const Verdicts v(CornerScene{}, T);
  EXPECT_GT(v.of(CellVerdict::through), kCells / 10);
  EXPECT_LT(v.of(CellVerdict::on), kCells * 9 / 10);
}

TEST(ViewCheck, OutsideTheMapNothingIsKnown) {
  Se3 T;
  T.translation = {0.0f, -30.0f, 0.0f};
  const CornerScene corner;
  const Verdicts v(corner, T);
  EXPECT_EQ(v.of(CellVerdict::on), 0);
}

ViewCheck good_check() {
  ViewCheck check;
  check.cells = 4000;
  check.on = 0.9f;
  check.front = 0.1f;
  check.luma_correlation = check.texture_correlation = 0.95f;
  check.weakest_m = 0.03f;
  return check;
}

TEST(ViewCheck, EveryRuleCanRefuse) {
  const RelocaliseParams p;
  EXPECT_TRUE(fits(good_check(), p));
  EXPECT_FALSE(fits(ViewCheck{}, p));
  const auto refused = [&](float ViewCheck::*what, float value) {
    ViewCheck check = good_check();
    check.*what = value;
    return !fits(check, p);
  };
  EXPECT_TRUE(refused(&ViewCheck::on, 0.1f));
  EXPECT_TRUE(refused(&ViewCheck::through, 0.2f));
  EXPECT_TRUE(refused(&ViewCheck::front, 0.9f));
  EXPECT_TRUE(refused(&ViewCheck::unknown, 0.8f));
  EXPECT_TRUE(refused(&ViewCheck::luma_correlation, 0.1f));
  EXPECT_TRUE(refused(&ViewCheck::texture_correlation, 0.1f));
  EXPECT_TRUE(refused(&ViewCheck::weakest_m, 1.0f));
}

}  // namespace
}  // namespace stillmap
