#include "kernels/complete/temporary_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "tests/support/corner_scene.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

constexpr float kFar_m = 9.0f;

/// A camera that moves a little from frame to frame.
Se3 completed_pose(float i) {
  const float s = 0.012f * i;
  return exp(Twist{{s, -0.6f * s, 0.5f * s}, {0.2f * s, 0.5f * s, -0.2f * s}});
}

/// Frames of a scene, the first of them to be completed from the others; what each pixel is stays open to
/// change.
struct CompletionRig {
  Intrinsics k;
  float pace;  ///< 0: the camera stands
  std::vector<std::vector<float>> depth_m;
  std::vector<std::vector<uint8_t>> mask;
  std::vector<float> truth_m;  ///< of the first

  explicit CompletionRig(float camera_pace = 1) : k(corner_camera(320)), pace(camera_pace) {
    for (size_t i = 0; i < 7; ++i) {
      depth_m.push_back(CornerView(CornerScene{}, k, cast<double>(pose(i))).depth_m);
      mask.emplace_back(depth_m.back().size(), uint8_t{0});
    }
    truth_m = depth_m[0];
  }

  Se3 pose(size_t i) const { return completed_pose(pace * static_cast<float>(i)); }
  size_t at(int32_t row, int32_t col) const { return static_cast<size_t>(row * k.width + col); }
  /// Of frame i the pixels of a rectangle.
  template <class T>
  void set(std::vector<T>& image, int32_t row0, int32_t row1, int32_t col0, int32_t col1, T value) const {
    for (int32_t r = row0; r < row1; ++r)
      for (int32_t c = col0; c < col1; ++c) image[at(r, c)] = value;
  }

  std::vector<float> completed(const NearEcho& echo = {}) const {
    TemporaryModel model;
    model.k = k;
    model.truncation_m = 0.1f;
    model.cell_px = start_cell_px(k.width);
    model.cell_rows = (k.height + model.cell_px - 1) / model.cell_px;
    model.cell_cols = (k.width + model.cell_px - 1) / model.cell_px;
    const auto view = [&](auto& image) { return ImageView{image.data(), k.height, k.width, k.width}; };
    std::vector<ModelFrame> frames;
    for (size_t i = 1; i < depth_m.size(); ++i) {
      const Se3 T_target_frame = inverse(pose(0)) * pose(i);
      frames.push_back({view(depth_m[i]), view(mask[i]), inverse(T_target_frame), T_target_frame});
    }
    model.frame = frames.data();
    model.frames = static_cast<int32_t>(frames.size());
    const auto cells = static_cast<size_t>(model.cell_rows * model.cell_cols);
    std::vector<uint32_t> start(frames.size() * cells, TemporaryModel::kNoStart);
    model.start = {start.data(), static_cast<uint32_t>(start.size())};
    std::vector<uint8_t> silent(cells);
    const ImageView<uint8_t> silent_view{silent.data(), model.cell_rows, model.cell_cols, model.cell_cols};
    const StartDepthPass starts{model};
    const SilentCellPass silences{model, view(depth_m[0]), silent_view, echo};
    for (int32_t r = 0; r < model.cell_rows; ++r)
      for (int32_t c = 0; c < model.cell_cols; ++c) {
        silences(r, c);
        for (int32_t i = 0; i < model.frames; ++i) starts(i, r, c);
      }
    std::vector<float> out(depth_m[0].size(), -1.0f);
    const CompletePass pass{model, view(depth_m[0]), view(mask[0]), view(out), silent_view, echo, kFar_m};
    for (int32_t r = 0; r < k.height; ++r)
      for (int32_t c = 0; c < k.width; ++c) pass(r, c);
    return out;
  }
};

TEST(TemporaryModel, ZerosGetTheDepthThatTheOtherFramesSee) {
  CompletionRig rig;
  for (size_t i = 0; i < rig.truth_m.size(); i += 3) rig.depth_m[0][i] = 0;  // noise
  rig.set(rig.depth_m[0], 60, 120, 80, 160, 0.0f);                           // and a hole
  const std::vector<float> out = rig.completed();
  double worst_m = 0, sum_m = 0;
  int filled = 0, left = 0, wrong = 0;
  for (int32_t r = 12; r < rig.k.height - 12; ++r)  // what the other frames see as well
    for (int32_t c = 12; c < rig.k.width - 12; ++c) {
      const size_t i = rig.at(r, c);
      if (rig.depth_m[0][i] > 0) {
        ASSERT_EQ(out[i], rig.truth_m[i]) << "a measured pixel was changed";
        continue;
      }
      left += out[i] == 0 ? 1 : 0;
      if (out[i] == 0) continue;
      const double off_m = std::fabs(static_cast<double>(out[i] - rig.truth_m[i]));
      wrong += off_m > 0.05 ? 1 : 0;
      if (off_m > 0.05) continue;
      ++filled;
      sum_m += off_m;
      worst_m = std::max(worst_m, off_m);
    }
  EXPECT_GT(filled, 20000);
  EXPECT_LT(left, filled / 100);
  EXPECT_EQ(wrong, 0);
  EXPECT_LT(sum_m / filled, 0.002);  // pixels of the others are met by their centres
  EXPECT_LT(worst_m, 0.03);
}

TEST(TemporaryModel, WhatNobodyHasMeasuredIsFar) {
  CompletionRig rig;
  for (auto& depth : rig.depth_m) rig.set(depth, 40, 200, 60, 260, 0.0f);
  const std::vector<float> out = rig.completed();
  for (int32_t r = 80; r < 160; ++r)  // some of its rim the others have seen
    for (int32_t c = 100; c < 220; ++c) ASSERT_EQ(out[rig.at(r, c)], kFar_m) << r << ", " << c;
}

TEST(TemporaryModel, ANarrowGapOfARowIsNotFar) {
  CompletionRig rig(0);
  for (auto& depth : rig.depth_m) {
    rig.set(depth, 40, 110, 100, 124, 0.0f);   // 24 of 320 columns
    rig.set(depth, 130, 200, 100, 180, 0.0f);  // 80
  }
  const std::vector<float> out = rig.completed();
  EXPECT_EQ(out[rig.at(75, 112)], 0.0f);
  EXPECT_EQ(out[rig.at(165, 140)], kFar_m);
}

TEST(TemporaryModel, MaskedPixelsAreNoPartOfItAndStayAsTheyAre) {
  CompletionRig rig;
  // A mover passes: in all frames a rectangle is something nearer, and known to move.
  for (size_t i = 0; i < rig.depth_m.size(); ++i) {
    rig.set(rig.depth_m[i], 60, 160, 80, 240, 0.6f);
    rig.set(rig.mask[i], 60, 160, 80, 240, uint8_t{255});
  }
  rig.set(rig.depth_m[0], 90, 130, 120, 200, 0.0f);  // not masked in the frame itself
  rig.set(rig.mask[0], 90, 110, 120, 200, uint8_t{0});
  const std::vector<float> out = rig.completed();
  EXPECT_EQ(out[rig.at(70, 100)], 0.6f);  // masked and measured
  EXPECT_EQ(out[rig.at(120, 160)], 0.0f) << "masked and invalid: nothing is known of what is behind";
  for (int32_t c = 140; c < 180; ++c)
    ASSERT_TRUE(out[rig.at(100, c)] == 0.0f || out[rig.at(100, c)] == kFar_m) << out[rig.at(100, c)];
  // The same mover without a mask would be a surface.
  for (auto& mask : rig.mask) std::fill(mask.begin(), mask.end(), uint8_t{0});
  EXPECT_NEAR(rig.completed()[rig.at(100, 160)], 0.6f, 0.05f);
}

TEST(TemporaryModel, WhatOneFrameAloneSaysOrMostSeeThroughIsUnsure) {
  CompletionRig alone;
  for (auto& depth : alone.depth_m) alone.set(depth, 40, 200, 60, 260, 0.0f);
  alone.set(alone.depth_m[3], 80, 160, 100, 220, 1.0f);
  EXPECT_EQ(alone.completed()[alone.at(120, 160)], 0.0f);
  CompletionRig seen_through;
  seen_through.set(seen_through.depth_m[0], 40, 200, 60, 260, 0.0f);
  for (const size_t i : {1u, 2u}) seen_through.set(seen_through.depth_m[i], 60, 180, 80, 240, 0.5f);
  const std::vector<float> out = seen_through.completed();
  const size_t middle = seen_through.at(120, 160);
  EXPECT_TRUE(out[middle] == 0.0f || std::fabs(out[middle] - seen_through.truth_m[middle]) < 0.05f)
      << out[middle];
}

TEST(TemporaryModel, WhatTheSonarHearsIsNeitherFarNorFilled) {
  CompletionRig rig;
  // A hand that hides three quarters of the width, in the first frame only; beside it its shadow in all of
  // them.
  rig.set(rig.depth_m[0], 0, 240, 40, 280, 0.0f);
  for (auto& depth : rig.depth_m) rig.set(depth, 0, 240, 40, 120, 0.0f);
  NearEcho echo;
  echo.axis_cam = {0, 0, 1};
  echo.cos_half_beam = std::cos(0.2f);
  echo.range_m = 0.2f;
  echo.until_m = 0.5f;
  const auto col_of = [&](float x) { return static_cast<int32_t>(std::lround(rig.k.cx + rig.k.fx * x)); };
  const auto row = static_cast<int32_t>(std::lround(rig.k.cy));
  const int32_t inside = col_of(0.15f), outside = col_of(0.28f), shadow = 70;
  ASSERT_LT(outside, 280);
  const std::vector<float> deaf = rig.completed(), out = rig.completed(echo);
  EXPECT_NEAR(deaf[rig.at(row, inside)], rig.truth_m[rig.at(row, inside)], 0.05f);
  EXPECT_EQ(out[rig.at(row, inside)], 0.0f);
  EXPECT_NEAR(out[rig.at(row, outside)], rig.truth_m[rig.at(row, outside)], 0.05f) << "seen by others";
  EXPECT_EQ(deaf[rig.at(row, shadow)], kFar_m);
  EXPECT_EQ(out[rig.at(row, shadow)], 0.0f) << "the gap reaches into the cone";
  EXPECT_EQ(out[rig.at(4, shadow)], kFar_m) << "a row that the cone does not reach";
}

}  // namespace
}  // namespace stillmap
