// What the map says of a cell.

#include <gtest/gtest.h>

#include <vector>

#include "kernels/frame_rules.hpp"
#include "kernels/mask/cells.hpp"
#include "tests/support/corner_scene.hpp"

namespace stillmap {
namespace {

constexpr float kEvidenceVoxelM = 0.02f, kEvidenceTruncationM = 0.1f;

/// A view of the corner, a cell a pixel, compared with its map.
class EvidenceTest : public testing::Test {
 protected:
  EvidenceTest()
      : map(test::corner_map(scene, kEvidenceVoxelM, kEvidenceTruncationM)), view(scene, camera, Se3d{}) {
    cells.px = 1;
    cells.k = camera;
    cells.depth_m = image(depth, 0.0f);
    std::copy(view.depth_m.begin(), view.depth_m.end(), depth.begin());
    cells.luma = image(luma, 20000.0f);
    cells.normal = image(normal, Vec3{0, 0, -1});
    cells.residual = image(residual, CellResidual{});
    cells.evidence = image(evidence, kUnknown);
    cells.fused = image(fused, uint8_t{255});
    pass.cells = cells;
    pass.track.map = map.view();
    pass.track.depth_m = cells.depth_m;
    pass.track.k = camera;
    pass.track.max_m = 5.0f;
    pass.track.weights = {kEvidenceTruncationM / static_cast<float>(kSdfMax),
                          1.0f / kEvidenceVoxelM,
                          0.025f,
                          0.03f,
                          RobustKernel::huber,
                          0.02f};
    pass.noise = {0.001f, 0.0015f, 0.0f};
    pass.contradict_m = 0.05f;
    pass.contradict_sigmas = 2.0f;
  }
  template <class T>
  ImageView<T> image(std::vector<T>& data, T value) {
    data.assign(static_cast<size_t>(camera.width * camera.height), value);
    return {data.data(), camera.height, camera.width, camera.width};
  }
  void look(int32_t row, int32_t col) {
    BlockCache cache;
    pass(row, col, cache);
  }

  static constexpr int32_t kRow = 20, kCol = 16;  ///< of a cell on the back wall
  test::CornerScene scene;
  Intrinsics camera = test::corner_camera(80);
  AnalyticMap map;
  test::CornerView view;
  std::vector<float> depth, luma;
  std::vector<Vec3> normal;
  std::vector<CellResidual> residual;
  std::vector<Contradiction> evidence;
  std::vector<uint8_t> fused;
  CellGrid cells;
  CellEvidencePass pass;
};

TEST_F(EvidenceTest, OnTheSurfaceNothingContradicts) {
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 0.0f);
  EXPECT_GT(cells.residual.at(kRow, kCol).terms.depth_weight, 0.0f);
  EXPECT_EQ(cells.fused.at(kRow, kCol), 1);  // the map was seen once
}

TEST_F(EvidenceTest, WellBeforeTheSurfaceItDoesInFull) {
  cells.depth_m.at(kRow, kCol) -= 0.075f;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f);
}

TEST_F(EvidenceTest, SpaceIsEmptyOnceItWasSeenOftenHereAndAround) {
  cells.depth_m.at(kRow, kCol) -= 0.075f;
  pass.empty_looks = 3;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), kUnknown);  // it was seen once
  const Vec3 p = cells.point(kRow, kCol);
  const auto nearest = [](float m) { return static_cast<int32_t>(std::lround(m / kEvidenceVoxelM)); };
  const Int3 at = {nearest(p.x), nearest(p.y), nearest(p.z)};
  map.record(at).weight = 3;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f);

  pass.empty_reach_voxels = 1;
  const Int3 neighbours[6] = {{at.x - 1, at.y, at.z}, {at.x + 1, at.y, at.z}, {at.x, at.y - 1, at.z},
                              {at.x, at.y + 1, at.z}, {at.x, at.y, at.z - 1}, {at.x, at.y, at.z + 1}};
  for (const Int3 neighbour : neighbours) {
    look(kRow, kCol);
    EXPECT_EQ(cells.evidence.at(kRow, kCol), kUnknown);
    map.record(neighbour).weight = 3;
  }
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f);
}

TEST_F(EvidenceTest, InAMapThatDriftedSpaceIsEmptyOnlyAwayFromItsSurfaces) {
  cells.depth_m.at(kRow, kCol) -= 0.075f;
  const Vec3 p = cells.point(kRow, kCol);
  const auto nearest = [](float m) { return static_cast<int32_t>(std::lround(m / kEvidenceVoxelM)); };
  const Int3 beside = {nearest(p.x) - 2, nearest(p.y), nearest(p.z)};
  pass.drift_voxels = 2;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f);
  map.surface(beside).sdf = kSdfUnobserved;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f) << "nobody looked there: no surface is known";
  map.surface(beside).sdf = -1;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), kUnknown);
  pass.drift_voxels = 1;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f) << "it drifted by less";
}

TEST(MapExtent, DriftIsAShareOfTheFarthestWayFromWhereTheMapBegan) {
  MaskParams mask;
  mask.drift = 0.002f;
  MapExtent extent;
  const auto drift_at = [&](float x_m, bool first = false) {
    extent.see({{}, {x_m, 0, 0}}, first);
    return extent.drift_m(mask);
  };
  EXPECT_EQ(drift_at(5, true), 0.0f);
  EXPECT_NEAR(drift_at(15), 0.02f, 1e-6f);
  EXPECT_NEAR(drift_at(10), 0.02f, 1e-6f) << "the way back does not mend it";
  EXPECT_NEAR(drift_at(100), 0.04f, 1e-6f) << "and there is a most of it";
  EXPECT_EQ(drift_at(100, true), 0.0f) << "a new map";
}

TEST(MapExtent, WhatDriftMayHaveDoneIsNoMotion) {
  MaskParams mask;
  mask.contradict_m = 0.05f;
  mask.blob_m2 = 0.004f;
  const MaskParams drifted = allowing(mask, 0.02f);
  EXPECT_NEAR(drifted.contradict_m, 0.07f, 1e-6f);
  EXPECT_NEAR(drifted.blob_m2, 0.014f, 1e-6f);
}

TEST_F(EvidenceTest, ASurfaceThatMovedAwayNeedsNoEmptySpace) {
  cells.depth_m.at(kRow, kCol) += 0.075f;
  cells.normal.at(kRow, kCol) = {};
  pass.empty_looks = 200;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f);
}

TEST_F(EvidenceTest, BehindAMappedSurfaceOnlyOneThatFacesTheSameWayContradicts) {
  const Vec3 point = cells.point(kRow, kCol);
  look(kRow, kCol);
  const Vec3 outward = normalized(cells.residual.at(kRow, kCol).terms.depth_gradient);
  cells.depth_m.at(kRow, kCol) += 0.075f;
  cells.normal.at(kRow, kCol) = outward;  // the same surface, moved away
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), 1.0f);
  cells.normal.at(kRow, kCol) = normalized(cross(outward, point));  // another one: that before it has gone
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), kUnknown);
}

TEST_F(EvidenceTest, WhereNothingWasEverSeenNobodyKnows) {
  cells.depth_m.at(kRow, kCol) += 0.5f;
  look(kRow, kCol);
  EXPECT_EQ(cells.evidence.at(kRow, kCol), kUnknown);
  EXPECT_EQ(cells.residual.at(kRow, kCol).terms.depth_weight, 0.0f);
  EXPECT_EQ(cells.fused.at(kRow, kCol), 0);
}

TEST_F(EvidenceTest, FusedCountsTheMeasurementsOnTheSurfaceNextToThePoint) {
  const Vec3 p =
      unproject(camera, static_cast<float>(kCol), static_cast<float>(kRow), depth[kRow * 80 + kCol]);
  const auto nearest = [](float m) { return static_cast<int32_t>(std::lround(m / kEvidenceVoxelM)); };
  VoxelRecord& record = map.record({nearest(p.x), nearest(p.y), nearest(p.z)});
  record.colour_weight = 17;
  record.weight = 60;  // free space counts here, but is no surface
  look(kRow, kCol);
  EXPECT_EQ(cells.fused.at(kRow, kCol), 17);
}

}  // namespace
}  // namespace stillmap
