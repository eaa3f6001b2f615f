#include "runtime/executive/publish_stage.hpp"

#include <chrono>

#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr std::chrono::milliseconds kWait{100};
constexpr int64_t kStatusPeriod_ns = 500'000'000;  ///< while no frame comes

}  // namespace

void PublishStage::run() {
  const heap_guard::Scope armed;
  int64_t said_ns = 0;
  while (true) {
    state_.publish.beat();
    // Asked before the look into the queue: what was put there before the end is found.
    const bool finish = finish_.load(std::memory_order_acquire);
    PublishItem item;
    const bool found = finish ? queue_.pop(item) : queue_.pop_within(item, kWait);
    send_ranges();
    if (!found && finish) return;
    if (found) {
      take(item);
      said_ns = monotonic_ns();
    } else if (monotonic_ns() - said_ns > kStatusPeriod_ns) {
      const StatusMessage status = maker_.status_without_frame();
      latest_.write(status);
      send(kStatusChannel, status);
      said_ns = monotonic_ns();
    }
  }
}

void PublishStage::take(const PublishItem& item) {
  if (!item.whole) {
    send(kPoseChannel, maker_.pose(item));
    pose_age_ms_ = static_cast<float>(monotonic_ns() - item.result.captured.ns) * 1e-6f;
    pose_of_ = item.result.sequence;
    pose_sent_ = true;
    return;
  }
  const bool sent = pose_sent_ && pose_of_ == item.result.sequence;
  const StatusMessage status = maker_.status(item, sent ? pose_age_ms_ : 0.0f);
  latest_.write(status);
  send(kStatusChannel, status);
}

void PublishStage::send_ranges() {
  for (RangeReading reading; ranges_.pop(reading);) send(kRangeChannel, maker_.range(reading));
}

template <class Message>
void PublishStage::send(const char* channel, const Message& message) {
  if (codec_ == nullptr || bus_ == nullptr) return;
  const uint32_t size = codec_->encode(message, View<uint8_t>{bytes_.data(), kDatagramBytes});
  const Status sent = size == 0 ? Status::capacity_exhausted
                                : bus_->publish(channel, View<const uint8_t>{bytes_.data(), size});
  if (sent == Status::ok)
    state_.faults.clear(Fault::bus_unavailable);
  else
    state_.faults.hold(Fault::bus_unavailable, monotonic_ns());
}

}  // namespace stillmap
