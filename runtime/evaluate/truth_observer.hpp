#pragma once

// Looks over a run's shoulder with the truth in hand.

#include <memory>
#include <optional>
#include <vector>

#include "runtime/evaluate/mask_score.hpp"
#include "runtime/evaluate/pose_score.hpp"
#include "runtime/evaluate/surface_score.hpp"
#include "runtime/ports/frame_observer.hpp"

namespace stillmap {

/// One frame beside its truth; NaN where unknown.
struct FrameAgainstTruth {
  Stamp stamp;
  TrackingState state = TrackingState::good;
  float p_good = 0, inlier_ratio = 0;
  PoseErrors pose;
  StaticShares static_share;
  double mask_iou = 0;       ///< NaN also where nothing moves and nothing is masked
  double static_masked = 0;  ///< of the truly static pixels
};

/// Scores poses, masks and the seen surface while a run goes on. Memory: the watched points, and a row a
/// frame.
class TruthObserver final : public FrameObserver {
 public:
  void begin(const FrameSource& source, const SourceInfo& info) override;
  void see(const RgbdFrame& frame, const FrameResult& result, const Engine& engine) override;

  const PoseCounts& poses() const { return poses_.counts(); }
  const MaskScore& masks() const { return masks_; }
  const std::vector<FrameAgainstTruth>& frames() const { return frames_; }
  /// Points of the true static surface that were seen for at least a second, map frame, metres. Empty where
  /// the source does not know the surface.
  std::vector<Vec3> seen_surface_map() const;

 private:
  std::optional<MaskCounts> compare_masks(const RgbdFrame& frame, const FrameResult& result,
                                          const Engine& engine);

  Intrinsics k_;
  std::unique_ptr<MaskComparison> comparison_;
  std::unique_ptr<SeenSurface> surface_;
  MaskScore masks_;
  PoseScore poses_;
  std::vector<FrameAgainstTruth> frames_;
};

}  // namespace stillmap
