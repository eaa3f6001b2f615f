#pragma once

// How well the dynamic pixels of a frame were found, against a true mask.

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "kernels/base/view.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

inline constexpr float kValidDepthMin_m = 0.1f;  ///< valid depth, where truth is asked, ends here ...
inline constexpr float kValidDepthMax_m = 5.0f;  ///< ... and here
inline constexpr int32_t kBorder_px = 3;         ///< pixels so near to an edge of the true mask do not count

/// The pixels of one frame in classes. "judged": valid depth, not within kBorder_px of an edge of the
/// true mask, and not of a thing that was put down within the last second: a mover gets a second to show
/// itself, and a thing that stops one to be believed.
struct MaskCounts {
  int64_t pixels = 0;
  int64_t truly_dynamic = 0;                    ///< valid or not
  int64_t valid = 0, valid_static = 0;          ///< the border counts here
  int64_t judged_both = 0;                      ///< masked and truly dynamic
  int64_t judged_either = 0;                    ///< masked or truly dynamic
  int64_t judged_static = 0, judged_false = 0;  ///< truly static; of these, masked
  int64_t put_down = 0, put_down_masked = 0;    ///< static for less than a second; of these, masked

  double static_share_of_valid() const { return share(valid_static, valid); }
  double static_share_of_view() const { return share(valid_static, pixels); }

 private:
  static double share(int64_t part, int64_t all) {
    return all == 0 ? 0 : static_cast<double>(part) / static_cast<double>(all);
  }
};

/// Compares masks of one size; its memory is taken once. @thread one caller at a time
class MaskComparison {
 public:
  MaskComparison(int32_t rows, int32_t cols);

  /// @param truth as RgbdFrame's  @param mask 0: static, all else dynamic  @param depth_m 0: invalid
  /// All of the size given at the start.                                  test: mask_score_test
  MaskCounts compare(ImageView<const uint8_t> truth, ImageView<const uint8_t> mask,
                     ImageView<const float> depth_m);

 private:
  void find_edges(ImageView<const uint8_t> truth);

  int32_t rows_, cols_;
  std::vector<uint8_t> along_row_, near_;  // bit 0: something static near by, bit 1: something dynamic
};

/// Adds frames up.
class MaskScore {
 public:
  /// @param stamp rises from frame to frame
  void add(Stamp stamp, const MaskCounts& counts);

  /// Mean intersection over union of the frames in which a mover has covered over 2 % of the view for at
  /// least a second, the first second of the run left out. NaN: there was none.
  double iou() const { return mean(iou_sum_, iou_frames_); }
  uint64_t iou_frames() const { return iou_frames_; }
  /// Mean over all frames of the share of truly static pixels that were masked. NaN: no frame.
  double static_masked() const { return mean(false_sum_, false_frames_); }
  /// The same with what was put down within the last second.
  double still_masked() const { return mean(still_sum_, still_frames_); }

 private:
  static double mean(double sum, uint64_t n) {
    return n == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(n);
  }
  bool mover_known(Stamp stamp, const MaskCounts& counts);

  std::optional<Stamp> first_, covered_since_;
  double iou_sum_ = 0, false_sum_ = 0, still_sum_ = 0;
  uint64_t iou_frames_ = 0, false_frames_ = 0, still_frames_ = 0;
};

}  // namespace stillmap
