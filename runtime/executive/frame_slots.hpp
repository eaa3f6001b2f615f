#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "runtime/core/semaphore.hpp"
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
  Semaphore freed_;
};

/// Hands frames from one thread to another. At the start a few may wait, in their order: the first frame,
/// which makes the map, takes longer than those after it. From `newest_wins` on there is room for one, and a
/// newer one takes its place.
class FrameMailbox {
 public:
  static constexpr int32_t kEmpty = -1;
  static constexpr uint32_t kMostWaiting = 4;

  /// @thread one; does not wait
  void put(uint32_t slot);
  /// @return the slot of the oldest frame of more than may wait, or kEmpty: there are not more.  @thread
  /// put's
  int32_t crowded_out();
  /// @return the slot of the oldest frame, or kEmpty when none came within the time.  @thread one, another
  /// than put's
  int32_t take(std::chrono::milliseconds time);
  /// @thread take's
  void newest_wins() { most_.store(1, std::memory_order_relaxed); }
  bool empty() const { return waiting_.load(std::memory_order_relaxed) == 0; }

 private:
  int32_t pop(uint32_t unless_fewer_than);

  /// A byte each, slot + 1, the oldest lowest.
  alignas(64) std::atomic<uint64_t> waiting_{0};
  std::atomic<uint32_t> most_{kMostWaiting};
  Semaphore filled_;
};

}  // namespace stillmap
