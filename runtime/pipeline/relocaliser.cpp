#include "runtime/pipeline/relocaliser.hpp"

namespace stillmap {

namespace {
/// Neighbouring frames show the same: looking at every third is enough.
constexpr uint32_t kKeyframeEvery = 3;
}  // namespace

void Relocaliser::remember(const Se3d& T_map_cam) {
  if (params_.enabled && remembered_++ % kKeyframeEvery == 0) engine_->remember_place(cast<float>(T_map_cam));
}

std::optional<Se3d> Relocaliser::find(const Se3d& T_map_cam_last) {
  last_ = fitted_ > 0 ? engine_->confirm_place(last_.T_map_cam)
                      : engine_->find_place(cast<float>(T_map_cam_last), attempt_++);
  fitted_ = last_.status == Status::ok ? fitted_ + 1 : 0;
  if (fitted_ == 0 || fitted_ <= params_.confirm_frames) return std::nullopt;
  attempt_ = fitted_ = 0;
  return cast<double>(last_.T_map_cam);
}

}  // namespace stillmap
