#include "runtime/executive/looped_source.hpp"

#include <algorithm>

namespace stillmap {
namespace {

template <class T>
void copy_image(ImageView<T> from, ImageView<T> to) {
  for (int32_t row = 0; row < to.rows; ++row) std::copy_n(from.row(row), to.cols, to.row(row));
}

}  // namespace

LoopedSource::LoopedSource(FrameSource& source, uint32_t frames) : info_(source.info()) {
  constexpr int32_t kWaitMs = 1000;
  while (frames_.size() < frames) {
    auto slot = std::make_unique<FrameSlot>(info_);
    const Status status = source.next(slot->frame(), kWaitMs);
    if (status == Status::ok) frames_.push_back(std::move(slot));
    if (status == Status::end || status == Status::unavailable) break;
  }
  error_ = source.error();
  info_.frames = -1;
  if (frames_.size() >= 2)
    period_ns_ = frames_[1]->frame().depth_stamp.ns - frames_[0]->frame().depth_stamp.ns;
}

Status LoopedSource::next(RgbdFrame& frame, int32_t) {
  if (frames_.size() < 2) return Status::unavailable;
  const auto last = static_cast<uint32_t>(frames_.size()) - 1;
  const uint32_t at = played_ % (2 * last);
  const RgbdFrame& from = frames_[at <= last ? at : 2 * last - at]->frame();
  copy_image(from.depth_raw, frame.depth_raw);
  copy_image(from.colour, frame.colour);
  if (frame.truth_mask.data != nullptr) copy_image(from.truth_mask, frame.truth_mask);
  frame.truth_T_world_cam = from.truth_T_world_cam;
  frame.sequence = played_;
  frame.depth_stamp = frame.colour_stamp =
      Stamp{frames_[0]->frame().depth_stamp.ns + int64_t{played_} * period_ns_};
  ++played_;
  return Status::ok;
}

}  // namespace stillmap
