#pragma once

// A temporary model of a few frames, and the virtual depth that it gives for a pixel of one more (paper
// III-E). The model is the frames themselves: the signed distance of a point is the mean of what each of them
// says by its own depth image, truncated, which is what a volume fused from them would hold if its voxels
// were as fine as the images; nothing has to be fused and taken out again. A ray finds its surface from a
// coarse start: where the points of each frame fall in the picture that is completed.

// Not <cstring>: plain memcpy works on both engines.
#include <string.h>  // NOLINT(modernize-deprecated-headers)

#include <cstdint>

#include "kernels/base/atomic.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/base/view.hpp"
#include "kernels/complete/near_echo.hpp"

namespace stillmap {

constexpr int32_t kMostModelFrames = 60;  ///< depth.complete_frames at its most
/// A surface is one when so many frames of the model agree on it.
constexpr int32_t kLeastAgreeing = 2;

/// One of the frames. What is masked in it is no part of the model.
struct ModelFrame {
  ImageView<const float> depth_m;  ///< 0: invalid
  ImageView<const uint8_t> mask;
  Se3 T_frame_target;  ///< target: the frame that is completed
  Se3 T_target_frame;
};

/// Edge of the cells of the start depths, in pixels: 4 at 640 columns.
constexpr int32_t start_cell_px(int32_t width) {
  return width >= 320 ? width / 160 : 1;
}

/// The frames and, for each of them, the nearest of its points in each cell of the target's picture.
struct TemporaryModel {
  const ModelFrame* frame = nullptr;
  int32_t frames = 0;  ///< at most kMostModelFrames
  Intrinsics k;        ///< of all the images
  float truncation_m = 0;
  int32_t cell_px = 1;
  int32_t cell_rows = 0, cell_cols = 0;
  View<uint32_t> start;  ///< cells row-major, for each its frames: bits of a depth in metres; kNoStart

  static constexpr uint32_t kNoStart = 0xffffffffu;
  STILLMAP_HD uint32_t& start_at(int32_t i, int32_t row, int32_t col) const {
    return start[static_cast<uint32_t>((row * cell_cols + col) * frames + i)];
  }
  /// The pixel that stands for a cell.
  STILLMAP_HD int32_t middle_row(int32_t cell) const {
    const int32_t at = cell * cell_px + cell_px / 2;
    return at < k.height ? at : k.height - 1;
  }
  STILLMAP_HD int32_t middle_col(int32_t cell) const {
    const int32_t at = cell * cell_px + cell_px / 2;
    return at < k.width ? at : k.width - 1;
  }
};

/// Of positive numbers the order is that of their bits.
STILLMAP_HD uint32_t bits_of_depth(float z_m) {
  uint32_t bits = 0;
  memcpy(&bits, &z_m, sizeof bits);
  return bits;
}
STILLMAP_HD float depth_of_bits(uint32_t bits) {
  float z_m = 0;
  memcpy(&z_m, &bits, sizeof z_m);
  return z_m;
}

/// A gap between the measurements of a row that is at most so wide, a tenth of the picture, says nothing of
/// what lies far away.
constexpr int32_t kNarrowCells = 16;

/// Puts the pixel in the middle of one cell of one frame where it lies in the target's picture.
///                                                                              test: temporary_model_test
struct StartDepthPass {
  TemporaryModel model;

  STILLMAP_HD void operator()(int32_t i, int32_t cell_row, int32_t cell_col) const {
    const ModelFrame& from = model.frame[i];
    const int32_t row = model.middle_row(cell_row), col = model.middle_col(cell_col);
    const float z_m = from.depth_m.at(row, col);
    if (!(z_m > 0.0f) || from.mask.at(row, col) != 0) return;
    const Vec3 p =
        from.T_target_frame * unproject(model.k, static_cast<float>(col), static_cast<float>(row), z_m);
    if (!(p.z > 0.0f)) return;
    const Pixel at = project(model.k, p);
    if (!(at.u > -0.5f && at.v > -0.5f && at.u < static_cast<float>(model.k.width) - 0.5f &&
          at.v < static_cast<float>(model.k.height) - 0.5f))
      return;
    const int32_t c = static_cast<int32_t>(at.u + 0.5f) / model.cell_px,
                  r = static_cast<int32_t>(at.v + 0.5f) / model.cell_px;
    atomic_least(&model.start_at(i, r, c), bits_of_depth(p.z));
  }
};

/// Whether nothing follows from a cell of the target that was not measured. In a narrow gap between the
/// measurements of its row it lies in the shadow of the projector beside what is near, or was missed. And
/// where the gap reaches, along the row or the column, to what the sonar has heard, that thing or its shadow
/// may fill it.
///                                                                              test: temporary_model_test
struct SilentCellPass {
  TemporaryModel model;
  ImageView<const float> depth_m;  ///< of the target, 0: invalid
  ImageView<uint8_t> silent;       ///< of each cell: 1 or 0
  NearEcho echo;                   ///< of the target

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    const int32_t right = gap_to(row, col, 1);
    const bool narrow = right <= kNarrowCells && right + gap_to(row, col, -1) <= kNarrowCells;
    silent.at(row, col) = narrow || (echo.range_m > 0.0f && reaches_echo(row, col)) ? 1 : 0;
  }

 private:
  STILLMAP_HD bool measured(int32_t row, int32_t col) const {
    return depth_m.at(model.middle_row(row), model.middle_col(col)) > 0.0f;
  }
  /// Cells from this one to the next measured one of the row; kNarrowCells + 1: there is none near.
  STILLMAP_HD int32_t gap_to(int32_t row, int32_t col, int32_t step) const {
    for (int32_t n = 0; n <= kNarrowCells; ++n) {
      const int32_t c = col + n * step;
      if (c < 0 || c >= model.cell_cols) break;
      if (measured(row, c)) return n;
    }
    return kNarrowCells + 1;
  }
  STILLMAP_HD bool reaches_echo(int32_t row, int32_t col) const {
    const Vec3 aim = echo.place_cam + echo.until_m * echo.axis_cam;
    if (!(aim.z > 0.0f)) return false;
    const Pixel at = project(model.k, aim);
    return walk_to_echo(row, col, 0, at.u < static_cast<float>(model.middle_col(col)) ? -1 : 1) ||
           walk_to_echo(row, col, at.v < static_cast<float>(model.middle_row(row)) ? -1 : 1, 0);
  }
  STILLMAP_HD bool walk_to_echo(int32_t row, int32_t col, int32_t down, int32_t right) const {
    for (; row >= 0 && row < model.cell_rows && col >= 0 && col < model.cell_cols;
         row += down, col += right) {
      if (measured(row, col)) return false;
      const auto u = static_cast<float>(model.middle_col(col)), v = static_cast<float>(model.middle_row(row));
      if (echo.may_be_on(unproject(model.k, u, v, 1.0f))) return true;
    }
    return false;
  }
};

/// What the model says of a ray.
enum class VirtualDepth : uint8_t {
  nothing,  ///< no frame has measured anything there
  unsure,   ///< too few have, or more of them see through it
  surface
};

/// The ray through a pixel of the target, into the model.                      test: temporary_model_test
/// @param depth_m set for `surface`
STILLMAP_HD VirtualDepth cast_into(const TemporaryModel& model, int32_t row, int32_t col, float& depth_m) {
  uint32_t start[kMostModelFrames];
  int32_t starts = 0;
  for (int32_t i = 0; i < model.frames; ++i) {
    const uint32_t bits = model.start_at(i, row / model.cell_px, col / model.cell_px);
    if (bits == TemporaryModel::kNoStart) continue;
    int32_t at = starts++;
    for (; at > 0 && start[at - 1] > bits; --at) start[at] = start[at - 1];
    start[at] = bits;
  }
  if (starts == 0) return VirtualDepth::nothing;
  float z_m = depth_of_bits(start[(starts - 1) / 2]);
  int32_t agree = 0, through = 0;
  constexpr int32_t kSteps = 2;  // the second one ends it: a start is at most a cell away
  for (int32_t step = 0; step < kSteps; ++step) {
    float sum_m = 0;
    agree = through = 0;
    const Vec3 p_target = unproject(model.k, static_cast<float>(col), static_cast<float>(row), z_m);
    for (int32_t i = 0; i < model.frames; ++i) {
      const ModelFrame& frame = model.frame[i];
      const Vec3 p = frame.T_frame_target * p_target;
      if (!(p.z > 0.0f)) continue;
      const Pixel at = project(model.k, p);
      if (!(at.u > -0.5f && at.v > -0.5f && at.u < static_cast<float>(model.k.width) - 0.5f &&
            at.v < static_cast<float>(model.k.height) - 0.5f))
        continue;
      const int32_t c = static_cast<int32_t>(at.u + 0.5f), r = static_cast<int32_t>(at.v + 0.5f);
      const float seen_m = frame.depth_m.at(r, c);
      if (!(seen_m > 0.0f) || frame.mask.at(r, c) != 0) continue;
      const float sdf_m = seen_m - p.z;
      if (sdf_m >= model.truncation_m) {
        ++through;
      } else if (sdf_m > -model.truncation_m) {
        sum_m += sdf_m;
        ++agree;
      }
    }
    if (agree == 0) break;
    z_m += sum_m / static_cast<float>(agree);
  }
  if (agree == 0 && through == 0) return VirtualDepth::nothing;
  if (agree < kLeastAgreeing || agree < through) return VirtualDepth::unsure;
  depth_m = z_m;
  return VirtualDepth::surface;
}

/// One pixel of the completed depth image. Measured and masked pixels stay what they are.
///                                                                              test: temporary_model_test
struct CompletePass {
  TemporaryModel model;
  ImageView<const float> depth_m;   ///< of the target, 0: invalid
  ImageView<const uint8_t> mask;    ///< of the target
  ImageView<float> completed_m;     ///< 0: stays invalid
  ImageView<const uint8_t> silent;  ///< see SilentCellPass
  NearEcho echo;                    ///< of the target
  float far_m = 0;

  STILLMAP_HD void operator()(int32_t row, int32_t col) const {
    const float z_m = depth_m.at(row, col);
    completed_m.at(row, col) = z_m > 0.0f || mask.at(row, col) != 0 ? z_m : virtual_m(row, col);
  }

 private:
  STILLMAP_HD float virtual_m(int32_t row, int32_t col) const {
    if (echo.may_be_on(unproject(model.k, static_cast<float>(col), static_cast<float>(row), 1.0f)))
      return 0.0f;
    float found_m = 0;
    switch (cast_into(model, row, col, found_m)) {
      case VirtualDepth::surface:
        return found_m;
      case VirtualDepth::nothing:
        return silent.at(row / model.cell_px, col / model.cell_px) != 0 ? 0.0f : far_m;
      case VirtualDepth::unsure:
        break;
    }
    return 0.0f;
  }
};

}  // namespace stillmap
