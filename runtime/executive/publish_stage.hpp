#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "runtime/executive/message_maker.hpp"
#include "runtime/executive/range_stage.hpp"
#include "runtime/ports/message_bus.hpp"
#include "runtime/ports/message_codec.hpp"

namespace stillmap {

/// The newest value, from one thread to another; neither waits for the other.
template <class T>
class Latest {
 public:
  /// @thread one
  void write(const T& value) {
    cells_[back_] = value;
    back_ = middle_.exchange(back_ | kNew, std::memory_order_acq_rel) & kIndex;
  }
  /// The newest that was written; T() before the first.  @thread one, may be another
  const T& read() {
    if ((middle_.load(std::memory_order_relaxed) & kNew) != 0)
      front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kIndex;
    return cells_[front_];
  }

 private:
  static constexpr uint32_t kIndex = 3, kNew = 4;
  std::array<T, 3> cells_{};
  uint32_t back_ = 0, front_ = 1;
  std::atomic<uint32_t> middle_{2};
};

/// Sends poses and readings of the sonar as they become known, and a status with every frame; between frames,
/// twice a second.
/// @thread run: publish; it does not allocate, lock or throw. latest: supervisor
class PublishStage {
 public:
  /// @param codec, bus null: nothing is sent, the status is made all the same  @param queue, ranges, state
  /// outlive this; who puts something into `ranges` wakes `queue`
  PublishStage(MessageMaker maker, PublishQueue& queue, RangeQueue& ranges, RunState& state,
               const MessageCodec* codec, MessageBus* bus)
      : maker_(maker), queue_(queue), ranges_(ranges), state_(state), codec_(codec), bus_(bus) {}

  /// Until `finish` and the queue is empty.
  void run();
  void finish() { finish_.store(true, std::memory_order_release); }

  const StatusMessage& latest() { return latest_.read(); }

 private:
  void take(const PublishItem& item);
  void send_ranges();
  template <class Message>
  void send(const char* channel, const Message& message);

  MessageMaker maker_;
  PublishQueue& queue_;
  RangeQueue& ranges_;
  RunState& state_;
  const MessageCodec* const codec_;
  MessageBus* const bus_;
  float pose_age_ms_ = 0;
  uint32_t pose_of_ = 0;  ///< sequence of the frame whose pose was sent last
  bool pose_sent_ = false;
  std::array<uint8_t, kDatagramBytes> bytes_{};
  Latest<StatusMessage> latest_;
  std::atomic<bool> finish_{false};
};

}  // namespace stillmap
