#include "kernels/backend/cpu/loops.hpp"
#include "kernels/mask/static_pixels.hpp"
#include "tests/unit/kernels/mask/parts_fixture.hpp"

namespace stillmap {
namespace {

TEST_F(PartsTest, AJumpInDepthPartsTwoSurfaces) {
  put(kBox, kNearM, 0);
  EXPECT_EQ(find_parts(), 2);
  EXPECT_NE(cells.part.at(30, 40), cells.part.at(5, 5));
  EXPECT_EQ(cells.part.at(5, 5), cells.part.at(55, 75));
}

TEST_F(PartsTest, AConcaveBendPartsTwoWallsOfACornerAndAConvexOneDoesNotPartABall) {
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c)
      cells.depth_m.at(r, c) = kWallM - 0.03f * std::fabs(static_cast<float>(c - 40));
  find_normals();
  EXPECT_EQ(find_parts(), 2);
  EXPECT_NE(cells.part.at(30, 10), cells.part.at(30, 70));

  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      const float d2 = static_cast<float>((r - 30) * (r - 30) + (c - 40) * (c - 40)) / 900.0f;
      cells.depth_m.at(r, c) = d2 < 0.8f ? 1.5f - 0.5f * std::sqrt(1.0f - d2) : 0.0f;
    }
  find_normals();
  EXPECT_EQ(find_parts(), 1);
}

TEST_F(PartsTest, APartThatContradictsTheMapIsDynamicAndNothingElse) {
  put(kBox, kNearM, 1);
  decide();
  EXPECT_EQ(dynamic_cells(kBox), 400);
  EXPECT_EQ(dynamic_cells(), 400);
}

TEST_F(PartsTest, TheWholePartGoesWithWhatMostOfItSays) {
  put(kBox, kNearM, 1);
  put({20, 24, 30, 50}, kNearM, kUnknown);  // its top is in space that was never seen
  put({38, 40, 30, 50}, kNearM, 0);         // its foot stands near something that was
  decide();
  EXPECT_EQ(dynamic_cells(kBox), 400);
}

TEST_F(PartsTest, WhatWasDynamicStaysSoOnLessEvidence) {
  put(kBox, kNearM, 0.35f);
  decide();
  EXPECT_EQ(dynamic_cells(), 0);
  in(kBox, [&](int32_t r, int32_t c) { cells.expected.at(r, c) = 255; });
  params.moved_m2 = 10;  // no large area that agrees is let go
  decide();
  EXPECT_EQ(dynamic_cells(kBox), 400);
  params.warp = false;
  decide();
  EXPECT_EQ(dynamic_cells(), 0);
}

TEST_F(PartsTest, ABlobOnAWallIsDynamicAndARimIsNot) {
  put({10, 11, 5, 70}, kWallM, 1);
  decide();
  EXPECT_EQ(dynamic_cells(), 0);
  put({30, 38, 30, 38}, kWallM, 1);
  params.grow_m = 0;
  decide();
  EXPECT_EQ(dynamic_cells(), 64);
}

TEST_F(PartsTest, TheMaskGrowsInMetresOverWhatTouchesIt) {
  put({30, 38, 30, 38}, kWallM, 1);
  put({20, 50, 38, 60}, kNearM, 0);  // in front, beside it
  params.grow_m = 0.08f;             // 2.1 cells of the wall
  decide();
  EXPECT_EQ(dynamic_cells({20, 50, 38, 60}), 0);
  EXPECT_EQ(dynamic_cells(), 64 + 2 * 8 + 2 * 2 * 10);
}

TEST_F(PartsTest, WhatStoodStillForLongIsStaticAgain) {
  put(kBox, kNearM, 1);
  in(kBox, [&](int32_t r, int32_t c) { cells.still.at(r, c) = 61; });
  decide();
  EXPECT_EQ(dynamic_cells(), 0);
  cells.settled_frames = 0;  // never
  decide();
  EXPECT_EQ(dynamic_cells(), 400);
}

TEST_F(PartsTest, AStandUnderAThingThatWasPutDownStaysStatic) {
  put({10, 34, 30, 50}, kNearM, 1);
  put({34, 55, 30, 50}, kNearM, 0);
  params.grow_m = 0;
  decide();
  EXPECT_EQ(dynamic_cells({10, 34, 30, 50}), 24 * 20);
  EXPECT_EQ(dynamic_cells({34, 55, 30, 50}), 0);
}

TEST_F(PartsTest, TheLargerSpaceDecidesWhatMovesNotTheLargerPicture) {
  const Patch box = {0, kRows, 10, 70};  // three quarters of the picture, a fifth of the space
  put(box, 0.7f, 0);
  shift({0, kRows, 0, kCols}, {});
  shift(box, {0.02f, 0, 0.01f});
  const int32_t count = find_parts();
  gather_parts(cells, count, memory, noise);
  const Twistd motion = agree_on_motion(count, memory, params, usual);
  EXPECT_LT(norm(motion.v), 0.002);
  expect(box, kDoubted);
  gather_parts(cells, count, memory, noise);
  agree_on_motion(count, memory, params, usual);
  decide_parts(cells, count, memory, params, usual);
  EXPECT_EQ(dynamic_cells(box), 60 * kRows);
  EXPECT_EQ(dynamic_cells(), 60 * kRows);
}

// The other side of a thin thing, or noise, lies off for one frame.
TEST_F(PartsTest, WhatLiesOffIsOnlyDoubtedTheFirstTime) {
  const Patch box = {0, kRows, 10, 70};
  put(box, 0.7f, 0);
  shift({0, kRows, 0, kCols}, {});
  shift(box, {0, 0, 0.01f});
  decide();
  EXPECT_EQ(dynamic_cells(), 0);
  EXPECT_EQ(cells.dynamic.at(kRows / 2, 40), kDoubted);
  EXPECT_EQ(cells.dynamic.at(kRows / 2, 75), 0);
  expect({0, kRows, 10, 35}, kDoubted);  // less than half of it: that was another thing
  decide();
  EXPECT_EQ(dynamic_cells(), 0);
  expect(box, kDoubted);
  decide();
  EXPECT_EQ(dynamic_cells(), 60 * kRows);
  put(box, 0.7f, 1);  // what the map saw free needs no second look
  expect(box, 0);
  decide();
  EXPECT_EQ(dynamic_cells(), 60 * kRows);
}

// It swings back towards where the map has it: what was dynamic stays so at an offset that shows no new
// mover.
TEST_F(PartsTest, AMoverThatComesNearItsOldPlaceIsStillOne) {
  const Patch box = {0, kRows, 10, 70};
  put(box, 0.7f, 0);
  shift({0, kRows, 0, kCols}, {});
  float of_limit = 0;  // how far the box lies off
  const auto dynamic_at = [&](float offset_m) {
    shift(box, {0, 0, offset_m});
    decide();
    const Part& found = memory.parts[static_cast<uint32_t>(cells.part.at(kRows / 2, 40))];
    of_limit = found.moved_m / may_move_m(found, params);
    return dynamic_cells();
  };
  const float far_m = 0.01f;
  expect(box, kDoubted);
  EXPECT_EQ(dynamic_at(far_m), 60 * kRows);
  ASSERT_GT(of_limit, 1.0f);
  const float nearer_m = far_m * 0.8f / of_limit, near_m = far_m * 0.3f / of_limit;
  EXPECT_EQ(dynamic_at(nearer_m), 0) << "it was static";
  EXPECT_NEAR(of_limit, 0.8f, 0.05f);
  in(box, [&](int32_t r, int32_t c) { cells.expected.at(r, c) = 255; });
  EXPECT_EQ(dynamic_at(nearer_m), 60 * kRows);
  EXPECT_EQ(dynamic_at(near_m), 0) << "back in its place";
}

// Noise has started the count of some cells of a thing that stands again; what has just come before it is no
// part of that.
TEST_F(PartsTest, OfAPartThatStandsHalfTheTimeWillDo) {
  const Patch begun_again = {20, 26, 30, 50}, rest = {26, 40, 30, 50};
  put(kBox, kNearM, 1);
  cells.settled_frames = 30;
  params.grow_m = 0;
  const auto dynamic_after = [&](int32_t frames) {
    in(rest, [&](int32_t r, int32_t c) { cells.still.at(r, c) = 40; });
    in(begun_again, [&](int32_t r, int32_t c) { cells.still.at(r, c) = static_cast<uint16_t>(frames); });
    decide();
    EXPECT_EQ(dynamic_cells(rest), 0);
    return dynamic_cells(begun_again);
  };
  EXPECT_EQ(dynamic_after(14), 6 * 20);
  EXPECT_EQ(dynamic_after(15), 0);
}

TEST_F(PartsTest, WhenTheCameraMovedNothingElseDid) {
  put(kBox, kNearM, 0);
  shift({0, kRows, 0, kCols}, {0.02f, -0.01f, 0.01f});
  const int32_t count = find_parts();
  gather_parts(cells, count, memory, noise);
  const Twistd motion = agree_on_motion(count, memory, params, usual);
  EXPECT_NEAR(motion.v.x, -0.02, 0.002);
  EXPECT_NEAR(motion.v.y, 0.01, 0.002);
  decide_parts(cells, count, memory, params, usual);
  EXPECT_EQ(dynamic_cells(), 0);
}

TEST_F(PartsTest, ASensorWithWarpedDepthRaisesWhatIsUsual) {
  put(kBox, kNearM, 0);
  shift({0, kRows, 0, kCols}, {});
  shift({0, 20, 0, kCols}, {0, 0, 0.03f});  // nothing fits: half of the wall, too
  const int32_t count = find_parts();
  gather_parts(cells, count, memory, noise);
  agree_on_motion(count, memory, params, usual);
  EXPECT_GE(usual, 1.0f);
  const float high = usual = 4.0f;
  shift({0, kRows, 0, kCols}, {});
  gather_parts(cells, count, memory, noise);
  agree_on_motion(count, memory, params, usual);
  EXPECT_LT(usual, high);
  EXPECT_GT(usual, 3.9f);  // it comes down in seconds, not at once
}

TEST_F(PartsTest, TheLastMaskIsCarriedIntoThisFrame) {
  in(kBox, [&](int32_t r, int32_t c) {
    before.dynamic.at(r, c) = 255;
    before.depth_m.at(r, c) = kNearM;
  });
  put({20, 40, 40, 60}, kNearM, 0);  // the camera turned: ten cells to the right
  const float angle = std::atan(10.0f / 80.0f);
  carry_mask(before.depth_m, before.dynamic, exp(Twist{{}, {0, angle, 0}}), cells);
  int32_t inside = 0, all = 0;
  in({0, kRows, 0, kCols}, [&](int32_t r, int32_t c) {
    all += cells.expected.at(r, c) != 0;
    inside += cells.expected.at(r, c) != 0 && Patch{20, 40, 40, 60}.holds(r, c);
  });
  EXPECT_GT(inside, 340);
  EXPECT_EQ(inside, all);  // never onto another surface
}

TEST_F(PartsTest, StandingStillIsCountedAndMovingOrCreepingIsNot) {
  StillPass pass{cells, before, {}, noise};
  const auto after = [&](int32_t r, int32_t c) {
    pass(r, c);
    return static_cast<int>(cells.still.at(r, c));
  };
  EXPECT_EQ(after(30, 40), 10);
  cells.luma.at(30, 40) = 40000.0f;  // another brightness: some of the count is lost
  EXPECT_EQ(after(30, 40), 1);
  cells.depth_m.at(30, 41) = kNearM;  // something came in front
  EXPECT_EQ(after(30, 41), 0);
  cells.depth_m.at(30, 42) = kWallM + 0.01f;
  EXPECT_EQ(after(30, 42), 10);
  before.crept_m.at(30, 42) = -0.035f;  // and on and on
  EXPECT_EQ(after(30, 42), 0);
  EXPECT_EQ(cells.crept_m.at(30, 42), 0.0f);
  cells.depth_m.at(30, 43) = 0;
  EXPECT_EQ(after(30, 43), 0);
}

TEST_F(PartsTest, WhatComesIntoViewGoesOnFromTheRimButNotInFull) {
  StillPass pass{cells, before, {}, noise, 6};
  const auto seen_from = [&](float cells_to_the_left) {
    pass.T_before_now.translation = {-cells_to_the_left * kWallM / 80.0f, 0, 0};
    pass(30, 1);
    return static_cast<int>(cells.still.at(30, 1));
  };
  EXPECT_EQ(seen_from(0), 10);
  EXPECT_EQ(seen_from(1), 10);
  EXPECT_EQ(seen_from(2), 6);
  EXPECT_EQ(seen_from(5), 6);
  EXPECT_EQ(seen_from(6), 0);  // too far beyond it
  before.still.at(30, 0) = 3;
  EXPECT_EQ(seen_from(2), 3);
  before.depth_m.at(30, 0) = kNearM;  // another surface
  EXPECT_EQ(seen_from(2), 0);
}

TEST_F(PartsTest, APixelBelongsToTheCellOfItsSurface) {
  put(kBox, kNearM, 1);
  in(kBox, [&](int32_t r, int32_t c) { cells.dynamic.at(r, c) = 255; });
  std::vector<float> depth_m(kRows * kCols, kWallM);
  std::vector<uint8_t> mask(kRows * kCols), trust(kRows * kCols);
  depth_m[30 * kCols + 29] = kNearM;                    // beside the box, at its depth
  depth_m[30 * kCols + 31] = kWallM;                    // within it, of the wall
  depth_m[30 * kCols + 28] = 0.5f * (kNearM + kWallM);  // flying, not next to it
  depth_m[31 * kCols + 29] = 0.5f * (kNearM + kWallM);  // flying beside it
  const DynamicPixelPass pixel{
      cells, {depth_m.data(), kRows, kCols, kCols}, {mask.data(), kRows, kCols, kCols}};
  TrustPass pass{cells,
                 {depth_m.data(), kRows, kCols, kCols},
                 {mask.data(), kRows, kCols, kCols},
                 {trust.data(), kRows, kCols, kCols},
                 noise,
                 0.01f,
                 0.0f};
  std::vector<uint8_t> all_at_once(kRows * kCols);
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      pixel(r, c);
      pass(r, c);
    }
  for (const CpuLoops* loops : runnable_loops()) {
    loops->dynamic_pixels({cells, pixel.depth_m, {all_at_once.data(), kRows, kCols, kCols}}, 0, kRows);
    EXPECT_EQ(all_at_once, mask) << loops->name;
  }
  EXPECT_EQ(mask[30 * kCols + 29], 255);
  EXPECT_EQ(mask[30 * kCols + 28], 0);
  EXPECT_EQ(mask[31 * kCols + 29], 255);
  EXPECT_EQ(trust[30 * kCols + 29], 0);
  EXPECT_GT(trust[0], 0);
  pass.probation_trust = 0.25f;
  pass.probation_ends_after = 10;
  cells.fused.at(0, 0) = 9;
  cells.fused.at(0, 1) = 10;
  pass(0, 0);
  pass(0, 1);
  EXPECT_NEAR(trust[0], 0.25f * trust[1], 1.0f);
  EXPECT_EQ(mask[0], 0);
  pass.mask = {};  // before the mask is known nothing is on probation
  pass(0, 0);
  EXPECT_EQ(trust[0], trust[1]);
}

/// The middle pixel sees the wall, whose normal leans by some angle.
TEST_F(PartsTest, NoiseAcrossTheRayCountsAtGrazingAnglesAndEdges) {
  noise = {0.0f, 0.002f, 0.002f};  // 18 mm along the ray, 6 mm across
  std::vector<float> depth_m(kRows * kCols, kWallM);
  std::vector<uint8_t> trust(kRows * kCols);
  const TrustPass pass{
      cells, {depth_m.data(), kRows, kCols, kCols}, {}, {trust.data(), kRows, kCols, kCols}, noise, 0.01f};
  const auto trusted = [&](Vec3 leaning) {
    cells.normal.at(30, 40) = leaning;
    pass(30, 40);
    return static_cast<float>(trust[30 * kCols + 40]) / 255.0f;
  };
  const auto weight = [](float variance_mm2) { return 100.0f / (100.0f + variance_mm2); };
  EXPECT_NEAR(trusted({0, 0, -1}), weight(18 * 18), 0.003f);
  EXPECT_NEAR(trusted({0, std::sqrt(0.75f), -0.5f}), weight(0.25f * 18 * 18 + 0.75f * 6 * 6), 0.003f);
  EXPECT_NEAR(trusted({}), weight(18 * 18 + 4 * 6 * 6), 0.003f);
  depth_m[30 * kCols + 40] = kWallM - 0.2f;  // not on the surface of its cell
  EXPECT_NEAR(trusted({0, std::sqrt(0.75f), -0.5f}), weight(15.68f * 15.68f + 4 * 5.6f * 5.6f), 0.003f);
}

/// A table comes out from under a masked box, where the map knows nothing.
TEST_F(PartsTest, WhereTheMapKnowsNothingOnlyWhatWasInsideTheMaskStaysInIt) {
  const auto masked = [&](uint8_t expected_as) {
    put(kBox, kNearM, kUnknown);
    in(kBox, [&](int32_t r, int32_t c) { cells.expected.at(r, c) = expected_as; });
    decide();
    return dynamic_cells(kBox) > 0;
  };
  EXPECT_TRUE(masked(255));
  EXPECT_FALSE(masked(kTouched));
  params.blob_m2 = 1.0f;  // larger than the box: a splinter
  EXPECT_FALSE(masked(255));
}

TEST_F(PartsTest, WhatTheMaskGrewOverOnlyTouchesIt) {
  put(kBox, kNearM, 1);
  in({kBox.row0, kBox.row1, kBox.col1, kBox.col1 + 6},
     [&](int32_t r, int32_t c) { cells.depth_m.at(r, c) = kNearM + 0.045f; });
  decide();
  EXPECT_EQ(cells.dynamic.at(30, kBox.col1 - 1), 255);
  EXPECT_EQ(cells.dynamic.at(30, kBox.col1), kTouched);
}

}  // namespace
}  // namespace stillmap
