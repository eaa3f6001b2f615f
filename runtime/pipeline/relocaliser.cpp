#include "runtime/pipeline/relocaliser.hpp"

namespace stillmap {

namespace {
/// Neighbouring frames show the same: looking at every third is enough.
constexpr uint32_t kKeyframeEvery = 3;
/// Frames in which the archive has brought what there is to see from one place.
constexpr int32_t kMostWaited = 60;
}  // namespace

void Relocaliser::remember(const Se3d& T_map_cam) {
  if (params_.enabled && remembered_++ % kKeyframeEvery == 0) engine_->remember_place(cast<float>(T_map_cam));
}

std::optional<Se3d> Relocaliser::find(const Se3d& T_map_cam_last) {
  if (fitted_ > 0) {
    last_ = engine_->confirm_place(last_.T_map_cam);
  } else {
    last_ = engine_->find_place(cast<float>(T_map_cam_last), attempt_);
    ArchivedGroup any;
    const bool incomplete = last_.status != Status::ok && engine_->wanted_groups({&any, 1}) > 0;
    const bool wait = incomplete && waited_ < kMostWaited;
    waited_ = wait ? waited_ + 1 : 0;
    attempt_ += !wait;
  }
  fitted_ = last_.status == Status::ok ? fitted_ + 1 : 0;
  if (fitted_ == 0 || fitted_ <= params_.confirm_frames) return std::nullopt;
  attempt_ = fitted_ = waited_ = 0;
  return cast<double>(last_.T_map_cam);
}

}  // namespace stillmap
