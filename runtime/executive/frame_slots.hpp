#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <semaphore>
#include <vector>

#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Memory of one frame, with the size that a source says, and of what the engine made of it.
class FrameSlot {
 public:
  explicit FrameSlot(const SourceInfo& info);

  RgbdFrame& frame() { return frame_; }
  /// 255: dynamic; the size of the frame. Written by the real-time thread where masks are recorded.
  ImageView<uint8_t> mask() { return mask_view_; }

  static uint64_t bytes(const SourceInfo& info);

 private:
  std::vector<uint16_t> depth_;
  std::vector<Rgb8> colour_;
  std::vector<uint8_t> truth_mask_, mask_;
  RgbdFrame frame_;
  ImageView<uint8_t> mask_view_;
};

/// Frame memory taken at boot; who holds a slot owns it. A slot number is what goes through queues.
class FrameSlots {
 public:
  static constexpr uint32_t kMost = 64;

  /// @param count 1..kMost.  @thread boot
  FrameSlots(const SourceInfo& info, uint32_t count);

  FrameSlot& operator[](uint32_t slot) { return *slots_[slot]; }
  uint32_t count() const { return static_cast<uint32_t>(slots_.size()); }
  /// Held by somebody.
  uint32_t in_use() const;

  /// A free slot. @return false: none came free within the time.  @thread any
  bool acquire(uint32_t& slot, std::chrono::milliseconds time);
  /// @thread any; does not wait
  void release(uint32_t slot);

 private:
  std::vector<std::unique_ptr<FrameSlot>> slots_;
  std::atomic<uint64_t> free_{0};  ///< a bit each
  std::counting_semaphore<> freed_;
};

/// Hands the newest frame from one thread to another: there is room for one, and a newer one takes its place.
class FrameMailbox {
 public:
  static constexpr int32_t kEmpty = -1;

  /// @return the slot of the older frame that nobody took, or kEmpty.  @thread one; does not wait
  int32_t put(uint32_t slot) {
    const int32_t older = slot_.exchange(static_cast<int32_t>(slot), std::memory_order_acq_rel);
    if (older == kEmpty) filled_.release();
    return older;
  }
  /// @return the slot, or kEmpty when none came within the time.  @thread one, another than put's
  int32_t take(std::chrono::milliseconds time) {
    if (!filled_.try_acquire_for(time)) return kEmpty;
    return slot_.exchange(kEmpty, std::memory_order_acq_rel);
  }

 private:
  alignas(64) std::atomic<int32_t> slot_{kEmpty};
  std::counting_semaphore<> filled_{0};
};

}  // namespace stillmap
