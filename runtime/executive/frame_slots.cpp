#include "runtime/executive/frame_slots.hpp"

#include <algorithm>
#include <bit>

namespace stillmap {
namespace {

size_t pixels_of(const SourceInfo& info) {
  return static_cast<size_t>(info.camera.k.height) * static_cast<size_t>(info.camera.k.width);
}

}  // namespace

FrameSlot::FrameSlot(const SourceInfo& info)
    : depth_(pixels_of(info)), colour_(pixels_of(info)), mask_(pixels_of(info)) {
  const int32_t rows = info.camera.k.height, cols = info.camera.k.width;
  frame_.depth_raw = {depth_.data(), rows, cols, cols};
  frame_.colour = {colour_.data(), rows, cols, cols};
  mask_view_ = {mask_.data(), rows, cols, cols};
  if (!info.has_truth_mask) return;
  truth_mask_.resize(pixels_of(info));
  frame_.truth_mask = {truth_mask_.data(), rows, cols, cols};
}

uint64_t FrameSlot::bytes(const SourceInfo& info) {
  const size_t of_pixel = sizeof(uint16_t) + sizeof(Rgb8) + 1 + (info.has_truth_mask ? 1 : 0);
  return pixels_of(info) * of_pixel;
}

FrameSlots::FrameSlots(const SourceInfo& info, uint32_t count) : freed_(0) {
  for (uint32_t i = 0; i < std::clamp(count, 1u, kMost); ++i) {
    slots_.push_back(std::make_unique<FrameSlot>(info));
    release(i);
  }
}

uint32_t FrameSlots::in_use() const {
  return count() - static_cast<uint32_t>(std::popcount(free_.load(std::memory_order_relaxed)));
}

bool FrameSlots::acquire(uint32_t& slot, std::chrono::milliseconds time) {
  if (!freed_.try_acquire_for(time)) return false;
  // The semaphore says that there is one for this caller; others may take theirs at the same time.
  uint64_t free = free_.load(std::memory_order_acquire);
  while (!free_.compare_exchange_weak(free, free & (free - 1), std::memory_order_acq_rel)) {
  }
  slot = static_cast<uint32_t>(std::countr_zero(free));
  return true;
}

void FrameSlots::release(uint32_t slot) {
  free_.fetch_or(uint64_t{1} << slot, std::memory_order_release);
  freed_.release();
}

}  // namespace stillmap
