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

FrameSlots::FrameSlots(const SourceInfo& info, uint32_t count) {
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

namespace {

uint32_t bytes_used(uint64_t word) {
  return (64 - static_cast<uint32_t>(std::countl_zero(word)) + 7) / 8;
}

}  // namespace

// One frame more than may wait is in there between `put` and `crowded_out`.
static_assert(FrameMailbox::kMostWaiting < sizeof(uint64_t) && FrameSlots::kMost < 255);

void FrameMailbox::put(uint32_t slot) {
  uint64_t was = waiting_.load(std::memory_order_relaxed);
  while (!waiting_.compare_exchange_weak(was, was | uint64_t{slot + 1} << 8 * bytes_used(was),
                                         std::memory_order_acq_rel)) {
  }
  filled_.release();
}

int32_t FrameMailbox::pop(uint32_t unless_fewer_than) {
  uint64_t was = waiting_.load(std::memory_order_acquire);
  do {
    if (was == 0 || bytes_used(was) < unless_fewer_than) return kEmpty;
  } while (!waiting_.compare_exchange_weak(was, was >> 8, std::memory_order_acq_rel));
  return static_cast<int32_t>(was & 0xff) - 1;
}

int32_t FrameMailbox::crowded_out() {
  const int32_t slot = pop(most_.load(std::memory_order_relaxed) + 1);
  if (slot != kEmpty) (void)filled_.try_acquire();  // may fail: then `take` finds nothing once
  return slot;
}

int32_t FrameMailbox::take(std::chrono::milliseconds time) {
  return filled_.try_acquire_for(time) ? pop(1) : kEmpty;
}

}  // namespace stillmap
