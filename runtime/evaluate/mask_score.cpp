#include "runtime/evaluate/mask_score.hpp"

#include <algorithm>

namespace stillmap {
namespace {

constexpr double kCoveredShare = 0.02;
constexpr int64_t kFirstSecondNs = 1'000'000'000;
constexpr uint8_t kStaticNear = 1, kDynamicNear = 2;

size_t size_of(int32_t rows, int32_t cols) {
  return static_cast<size_t>(rows) * static_cast<size_t>(cols);
}

}  // namespace

MaskComparison::MaskComparison(int32_t rows, int32_t cols)
    : rows_(rows), cols_(cols), along_row_(size_of(rows, cols)), near_(size_of(rows, cols)) {}

/// What lies in the square of 2 kBorder_px + 1 around each pixel: first along rows, then along columns.
void MaskComparison::find_edges(ImageView<const uint8_t> truth) {
  for (int32_t row = 0; row < rows_; ++row) {
    uint8_t* const out = along_row_.data() + row * cols_;
    for (int32_t col = 0; col < cols_; ++col) {
      uint8_t seen = 0;
      for (int32_t c = std::max(col - kBorder_px, 0); c <= std::min(col + kBorder_px, cols_ - 1); ++c)
        seen |= truth.at(row, c) == kTrulyDynamic ? kDynamicNear : kStaticNear;
      out[col] = seen;
    }
  }
  for (int32_t row = 0; row < rows_; ++row) {
    uint8_t* const out = near_.data() + row * cols_;
    std::fill_n(out, cols_, uint8_t{0});
    for (int32_t r = std::max(row - kBorder_px, 0); r <= std::min(row + kBorder_px, rows_ - 1); ++r)
      for (int32_t col = 0; col < cols_; ++col) out[col] |= along_row_[static_cast<size_t>(r * cols_ + col)];
  }
}

MaskCounts MaskComparison::compare(ImageView<const uint8_t> truth, ImageView<const uint8_t> mask,
                                   ImageView<const float> depth_m) {
  find_edges(truth);
  MaskCounts n;
  n.pixels = static_cast<int64_t>(rows_) * cols_;
  for (int32_t row = 0; row < rows_; ++row)
    for (int32_t col = 0; col < cols_; ++col) {
      const bool dynamic = truth.at(row, col) == kTrulyDynamic, masked = mask.at(row, col) != 0;
      const float z_m = depth_m.at(row, col);
      n.truly_dynamic += dynamic;
      if (!(z_m >= kValidDepthMin_m && z_m <= kValidDepthMax_m)) continue;
      ++n.valid;
      n.valid_static += !dynamic;
      if (near_[static_cast<size_t>(row * cols_ + col)] == (kStaticNear | kDynamicNear)) continue;
      if (truth.at(row, col) == kPutDown) {
        ++n.put_down;
        n.put_down_masked += masked;
        continue;
      }
      n.judged_both += masked && dynamic;
      n.judged_either += masked || dynamic;
      n.judged_static += !dynamic;
      n.judged_false += masked && !dynamic;
    }
  return n;
}

/// A mover has been in view for a second, and the map is older than that: what it hides was seen before, or
/// never will be.
bool MaskScore::mover_known(Stamp stamp, const MaskCounts& counts) {
  if (static_cast<double>(counts.truly_dynamic) <= kCoveredShare * static_cast<double>(counts.pixels)) {
    covered_since_.reset();
    return false;
  }
  if (!covered_since_) covered_since_ = stamp;
  return stamp.ns - covered_since_->ns >= kFirstSecondNs && stamp.ns - first_->ns >= kFirstSecondNs;
}

void MaskScore::add(Stamp stamp, const MaskCounts& counts) {
  if (!first_) first_ = stamp;
  if (mover_known(stamp, counts) && counts.judged_either > 0) {
    iou_sum_ += static_cast<double>(counts.judged_both) / static_cast<double>(counts.judged_either);
    ++iou_frames_;
  }
  const int64_t still = counts.judged_static + counts.put_down;
  if (still == 0) return;
  still_sum_ +=
      static_cast<double>(counts.judged_false + counts.put_down_masked) / static_cast<double>(still);
  ++still_frames_;
  if (counts.judged_static == 0) return;
  false_sum_ += static_cast<double>(counts.judged_false) / static_cast<double>(counts.judged_static);
  ++false_frames_;
}

}  // namespace stillmap
