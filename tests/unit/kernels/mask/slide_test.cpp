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
  /// Cells of the box that still count as still.
  int32_t still_after(const Se3& T_earlier_now = {}) {
    const int32_t count = find_parts();
    gather_parts(cells, count, memory, noise);
    agree_on_motion(count, memory, params, usual);
    restart_sliding(cells, count, memory, params, noise, earlier, T_earlier_now);
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

}  // namespace
}  // namespace stillmap
