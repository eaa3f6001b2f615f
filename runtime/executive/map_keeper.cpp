#include "runtime/executive/map_keeper.hpp"

namespace stillmap {
namespace {

constexpr int64_t kProgress_ns = 1'000'000'000;

}  // namespace

RunEvent MapKeeper::step(const FrameResult& result) {
  const auto period_ns = static_cast<int64_t>(static_cast<double>(config_.record.map_every_s) * 1e9);
  if (!due_) due_ = Stamp{result.stamp.ns + period_ns};
  if (due(result) && saver_.begin(MapInfo::of(config_, result.T_map_cam, result.stamp))) {
    saving_ = true;
    asked_ = lost_map_wanted_ = false;
    due_->ns = result.stamp.ns + period_ns;
  }
  last_state_ = result.state;
  saver_.step();
  return saving_ ? progress(result.stamp) : RunEvent{};
}

bool MapKeeper::due(const FrameResult& result) {
  const bool lost = result.state == TrackingState::lost;
  if (!lost) lost_map_wanted_ = false;
  if (lost && last_state_ != TrackingState::lost) lost_map_wanted_ = config_.lost.new_map_after_s > 0;
  return asked_ || lost_map_wanted_ || (!lost && config_.record.map_every_s > 0 && result.stamp >= *due_);
}

/// How far the save is, once a second; how it ended.
RunEvent MapKeeper::progress(Stamp stamp) {
  RunEvent event;
  event.stamp = stamp;
  const SaveProgress now = saver_.progress();
  event.of = now.groups;
  if (now.saving) {
    if (progress_due_ && stamp < *progress_due_) return event;
    progress_due_ = Stamp{stamp.ns + kProgress_ns};
    event.kind = RunEvent::Kind::map_save_progress;
    event.done = now.groups_done;
    return event;
  }
  saving_ = false;
  progress_due_.reset();
  const SaveResult& result = saver_.result();
  event.kind = result.error.empty() ? RunEvent::Kind::map_saved : RunEvent::Kind::map_save_failed;
  event.done = result.bytes;
  event.seconds = result.seconds;
  event.set_text(result.error.c_str());
  return event;
}

}  // namespace stillmap
