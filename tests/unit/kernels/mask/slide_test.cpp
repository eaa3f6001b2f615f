#include "kernels/mask/slide.hpp"

#include "tests/unit/kernels/mask/parts_fixture.hpp"

namespace stillmap {
namespace {

/// A box whose cells all count as still, with a faint pattern on its face, and the same box some time ago.
class SlideTest : public PartsTest {
 protected:
  SlideTest() : earlier{{depth_.data(), kRows, kCols, kCols}, {luma_.data(), kRows, kCols, kCols}, {}} {
    put(kBox, kNearM, 1);
    in(kBox, [&](int32_t r, int32_t c) {
      cells.still.at(r, c) = 200;
      cells.luma.at(r, c) = pattern(r, c, 0);
    });
    earlier_at({});
  }

  /// The box stood `from_here_m` from its place now.
  void earlier_at(Vec3 from_here_m) {
    in({0, kRows, 0, kCols}, [&](int32_t r, int32_t c) {
      const bool box = kBox.holds(r, c);
      earlier.depth_m.at(r, c) = box ? kNearM + from_here_m.z : kWallM;
      earlier.luma.at(r, c) = box ? pattern(r, c, from_here_m.x) : 20000.0f;
    });
  }
  static float pattern(int32_t r, int32_t c, float shift_m) {
    const float x_m = static_cast<float>(c) * kNearM / 80.0f - shift_m,
                y_m = static_cast<float>(r) * kNearM / 80.0f;
    return 20000.0f + 2000.0f * std::sin(20.0f * x_m) * std::cos(20.0f * y_m);
  }
  /// Three of twenty columns, at uneven distances.
  static float stripes(int32_t c) { return c % 20 == 3 || c % 20 == 8 || c % 20 == 10 ? 40000.0f : 20000.0f; }
  /// Cells of the box that still count as still.
  int32_t still_after(const Se3& T_earlier_now = {}) {
    const int32_t count = find_parts();
    gather_parts(cells, count, memory, noise);
    agree_on_motion(count, memory, params, usual);
    restart_sliding(cells, count, memory, params, noise, earlier, T_earlier_now, 0);
    int32_t left = 0, settled = 0;
    in(kBox, [&](int32_t r, int32_t c) { left += cells.still.at(r, c) != 0; });
    for (int32_t i = 0; i < count; ++i) settled += memory.parts[static_cast<uint32_t>(i)].settled;
    EXPECT_EQ(settled, left);
    return left;
  }

 private:
  std::vector<float> depth_ = std::vector<float>(kRows * kCols), luma_ = depth_;

 protected:
  EarlierCells earlier;
};

TEST_F(SlideTest, WhatStayedInItsPlaceStandsStill) {
  EXPECT_EQ(still_after(), 400);
}

TEST_F(SlideTest, AFaceThatSlidAlongItselfDoesNot) {
  earlier_at({0.02f, 0, 0});
  EXPECT_EQ(still_after(), 0);
}

// By more than its stripes are wide.
TEST_F(SlideTest, NorOneThatSlidFar) {
  in(kBox, [&](int32_t r, int32_t c) { cells.luma.at(r, c) = stripes(c); });
  in(kBox, [&](int32_t r, int32_t c) { earlier.luma.at(r, c) = stripes(c + 5); });
  EXPECT_EQ(still_after(), 0);
}

TEST_F(SlideTest, LightThatChangesIsNoSlide) {
  in(kBox, [&](int32_t r, int32_t c) { earlier.luma.at(r, c) += 3000.0f; });
  EXPECT_EQ(still_after(), 400);
}

TEST_F(SlideTest, NorWhatCameNearer) {
  earlier_at({0, 0, 0.02f});
  EXPECT_EQ(still_after(), 0);
}

TEST_F(SlideTest, ALittleIsNoise) {
  earlier_at({0.002f, 0, 0.002f});
  EXPECT_EQ(still_after(), 400);
}

TEST_F(SlideTest, WhatFitsTheMapIsNotAsked) {
  put(kBox, kNearM, 0);
  earlier_at({0.02f, 0, 0.02f});
  EXPECT_EQ(still_after(), 400);
}

TEST_F(SlideTest, ItIsTheThingThatSlidNotTheCamera) {
  Se3 T_earlier_now;
  T_earlier_now.translation = {0.02f, 0, 0.02f};
  earlier_at({0.02f, 0, 0.02f});  // seen so by a camera that has moved by as much
  EXPECT_EQ(still_after(T_earlier_now), 400);
}

TEST_F(SlideTest, AFrameThatSawNothingSaysNothing) {
  in({0, kRows, 0, kCols}, [&](int32_t r, int32_t c) { earlier.depth_m.at(r, c) = 0; });
  EXPECT_EQ(still_after(), 400);
}

// Masks 10, 20, 30 and 40 were kept, this one is the 45th after the first; the box stopped after the 23rd.
TEST_F(SlideTest, WhatSlidBeforeAFrameHasStoodStillSinceThat) {
  std::vector<EarlierCells> ring(kEarlier, earlier);  // of one picture: the box is where it is now
  std::vector<float> moved_depth(kRows * kCols), moved_luma(kRows * kCols);
  earlier_at({0.02f, 0, 0});
  moved_depth.assign(earlier.depth_m.data, earlier.depth_m.data + kRows * kCols);
  moved_luma.assign(earlier.luma.data, earlier.luma.data + kRows * kCols);
  earlier_at({});
  for (const int32_t slot : {1, 2}) {  // masks 10 and 20
    ring[static_cast<size_t>(slot)].depth_m.data = moved_depth.data();
    ring[static_cast<size_t>(slot)].luma.data = moved_luma.data();
  }
  const EarlierFrames frames{ring.data(), 45, 10};
  EXPECT_EQ(frames.age(1), 35);
  EXPECT_EQ(&frames.at(1), &ring[1]);
  EXPECT_EQ(&frames.at(3), &ring[3]);
  const int32_t count = find_parts();
  gather_parts(cells, count, memory, noise);
  agree_on_motion(count, memory, params, usual);
  restart_sliding(cells, count, memory, params, noise, frames, {});
  in(kBox,
     [&](int32_t r, int32_t c) { EXPECT_EQ(cells.still.at(r, c), 15); });  // since mask 30, 15 masks ago
}

/// The box lies a centimetre off its place in a map that may have drifted by two, and so it did a frame ago.
class DriftTest : public SlideTest {
 protected:
  DriftTest() {
    put(kBox, kNearM, 0);
    in(kBox, [&](int32_t r, int32_t c) { cells.still.at(r, c) = 0; });
    shift({0, kRows, 0, kCols}, {});
    shift(kBox, {0, 0, 0.012f});
    expect(kBox, kDoubted);
    params.moved_m2 = 0.01f;
    params.grow_m = 0;
    cells.drift_m = 0.02f;
  }
  /// Dynamic cells of the box; `stood` of the three frames that are kept saw it where it is, the others
  /// elsewhere.
  int32_t dynamic_after(int32_t stood, Vec3 elsewhere_m) {
    earlier_at(elsewhere_m);
    std::vector<float> moved_depth(earlier.depth_m.data, earlier.depth_m.data + kRows * kCols);
    std::vector<float> moved_luma(earlier.luma.data, earlier.luma.data + kRows * kCols);
    earlier_at({});
    std::vector<EarlierCells> ring(kEarlier, earlier);
    for (int32_t slot = 1 + stood; slot < kEarlier; ++slot) {
      ring[static_cast<size_t>(slot)].depth_m.data = moved_depth.data();
      ring[static_cast<size_t>(slot)].luma.data = moved_luma.data();
    }
    const int32_t count = find_parts();
    gather_parts(cells, count, memory, noise);
    agree_on_motion(count, memory, params, usual);
    const float off_map_m = box().moved_m;
    measure_slides(cells, count, memory, params, noise, {ring.data(), 40, 10}, {}, usual);
    EXPECT_EQ(box().moved_m, off_map_m);
    slid_m = box().slid_m;
    decide_parts(cells, count, memory, params, usual);
    return dynamic_cells(kBox);
  }
  const Part& box() { return memory.parts[static_cast<uint32_t>(cells.part.at(30, 40))]; }

  float slid_m = 0;
};

TEST_F(DriftTest, WhatLiesOffTheMapAloneHasNotMoved) {
  EXPECT_EQ(dynamic_after(3, {}), 0);
  EXPECT_LT(slid_m, 0.001f);
}

TEST_F(DriftTest, WhatLiesOffItsEarlierPlacesTooHasMoved) {
  EXPECT_EQ(dynamic_after(0, {0, 0, 0.012f}), 400);
  EXPECT_NEAR(slid_m, 0.012f, 0.002f);
}

TEST_F(DriftTest, OneFrameMayHaveBeenMatchedBadly) {
  EXPECT_EQ(dynamic_after(2, {0, 0, 0.012f}), 0);
  EXPECT_EQ(dynamic_after(1, {0, 0, 0.012f}), 400);
}

TEST_F(DriftTest, WhatStandsWhereNothingWasHasMoved) {
  EXPECT_EQ(dynamic_after(0, {0, 0, 1.0f}), 400);
  EXPECT_GT(slid_m, 0.5f);
}

TEST_F(DriftTest, FartherThanTheMapCanHaveDriftedNobodyAsks) {
  cells.drift_m = 0;
  EXPECT_EQ(dynamic_after(3, {}), 400);
  EXPECT_EQ(slid_m, 0.0f);
}

}  // namespace
}  // namespace stillmap
