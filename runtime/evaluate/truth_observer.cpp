#include "runtime/evaluate/truth_observer.hpp"

#include <algorithm>

#include "kernels/engine.hpp"
#include "runtime/evaluate/statistics.hpp"
#include "runtime/pipeline/pipeline.hpp"

namespace stillmap {
namespace {

double share(int64_t part, int64_t all) {
  return all == 0 ? kUnknown : static_cast<double>(part) / static_cast<double>(all);
}

/// A frame that was not used showed nothing to hold on to.
StaticShares static_shares(const std::optional<MaskCounts>& counts, Status status) {
  if (status != Status::ok) return {0, 0};
  if (!counts) return {kUnknown, kUnknown};
  return {counts->static_share_of_valid(), counts->static_share_of_view()};
}

}  // namespace

void TruthObserver::begin(const FrameSource& source, const SourceInfo& info) {
  k_ = info.camera.k;
  if (info.has_truth_mask) comparison_ = std::make_unique<MaskComparison>(k_.height, k_.width);
  if (const std::vector<Vec3> cloud = source.truth_cloud(); !cloud.empty())
    surface_ = std::make_unique<SeenSurface>(cloud);
  if (info.frames > 0) frames_.reserve(static_cast<size_t>(info.frames));
}

std::optional<MaskCounts> TruthObserver::compare_masks(const RgbdFrame& frame, const FrameResult& result,
                                                       const Engine& engine) {
  if (!comparison_ || result.status != Status::ok) return {};
  return comparison_->compare(frame.truth_mask, engine.mask_image(), engine.depth_image_m());
}

void TruthObserver::see(const RgbdFrame& frame, const FrameResult& result, const Engine& engine) {
  FrameAgainstTruth row{result.stamp, result.state, result.p_good, result.inlier_ratio,
                        {},           {},           kUnknown,      kUnknown};
  const std::optional<MaskCounts> counts = compare_masks(frame, result, engine);
  row.static_share = static_shares(counts, result.status);
  row.pose = poses_.add(result, frame.truth_T_world_cam, row.static_share);
  if (counts) {
    masks_.add(result.stamp, *counts);
    row.mask_iou = share(counts->judged_both, counts->judged_either);
    row.static_masked = share(counts->judged_false, counts->judged_static);
  }
  if (surface_ && frame.truth_T_world_cam && result.status == Status::ok)
    surface_->look(*frame.truth_T_world_cam, k_, engine.depth_image_m(), frame.truth_mask);
  frames_.push_back(row);
}

std::vector<Vec3> TruthObserver::seen_surface_map() const {
  if (!surface_ || !poses_.T_map_world()) return {};
  std::vector<Vec3> points = surface_->seen();
  const Se3d& T_map_world = *poses_.T_map_world();
  for (Vec3& p : points) {
    const Vec3d moved =
        T_map_world * Vec3d{static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
    p = {static_cast<float>(moved.x), static_cast<float>(moved.y), static_cast<float>(moved.z)};
  }
  return points;
}

}  // namespace stillmap
