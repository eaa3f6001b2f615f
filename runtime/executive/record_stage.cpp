#include "runtime/executive/record_stage.hpp"

#include <chrono>

namespace stillmap {
namespace {

constexpr std::chrono::milliseconds kWait{100};

}  // namespace

void RecordStage::run() {
  while (true) {
    state_.record.beat();
    // Asked before the look into the queue: what was put there before the end is found.
    const bool finish = finish_.load(std::memory_order_acquire);
    RunItem item;
    const bool found = finish ? queue_.pop(item) : queue_.pop_within(item, kWait);
    add_notices();
    add_ranges();
    if (found) {
      const bool kept = item.slot != RunItem::kNoSlot;
      const auto slot = static_cast<uint32_t>(item.slot);
      recorder_.add(item, kept ? &slots_[slot].frame() : nullptr,
                    kept ? ImageView<const uint8_t>(slots_[slot].mask()) : ImageView<const uint8_t>{});
      if (kept) slots_.release(slot);
    }
    recorder_.idle();
    if (finish && !found) return;
  }
}

void RecordStage::add_notices() {
  Notice notice;
  for (NoticeQueue* queue : {&from_capture_, &from_supervisor_, &ranges_.notices})
    while (queue->pop(notice)) recorder_.add(notice);
}

void RecordStage::add_ranges() {
  for (RangeReading reading; ranges_.to_record.pop(reading);) recorder_.add(reading);
}

}  // namespace stillmap
