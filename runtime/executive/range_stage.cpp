#include "runtime/executive/range_stage.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "runtime/core/clock.hpp"
#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr int64_t kMillisecond_ns = 1'000'000;
constexpr int64_t kWait_ns = 50 * kMillisecond_ns;  ///< how long a stop may go unseen
constexpr uint32_t kMostEdges = 64;                 ///< within kWait_ns, of a line without noise some four
constexpr std::chrono::milliseconds kRest{1};
constexpr int64_t kFirstWait_ns = 500 * kMillisecond_ns, kLongestWait_ns = 10'000 * kMillisecond_ns;

Stamp now_stamp() {
  return {monotonic_ns()};
}

}  // namespace

RangeStage::RangeStage(RangeSensor& sensor, const SonarConfig& sonar, RangeQueues& queues,
                       PublishQueue& to_publish, RunState& state)
    : sensor_(sensor),
      sonar_(sonar),
      queues_(queues),
      to_publish_(to_publish),
      state_(state),
      ranger_(sonar, now_stamp()) {}

void RangeStage::run() {
  while (!state_.stop.load(std::memory_order_relaxed)) {
    state_.sonar.beat();
    if (!is_open_ && monotonic_ns() >= open_at_ns_) open();
    if (is_open_)
      work();
    else
      std::this_thread::sleep_for(std::chrono::nanoseconds(kWait_ns));
  }
  if (is_open_ && !line_high_)
    sensor_.set_stop(true);  // when it is refused the lines are gone, and with them the level
}

void RangeStage::open() {
  const Status status = sensor_.open();
  const Stamp now = now_stamp();
  if (status != Status::ok) return give_up_for_a_while(now);
  is_open_ = true;
  line_high_ = true;
  if (was_gone_) ranger_.reopened(now);
}

/// The first time it is opened again at once, then less and less often. The reason is told once until edges
/// come again.
void RangeStage::give_up_for_a_while(Stamp now) {
  is_open_ = false;
  open_at_ns_ = now.ns + next_wait_ns_;
  next_wait_ns_ = std::clamp(2 * next_wait_ns_, kFirstWait_ns, kLongestWait_ns);
  state_.faults.hold(Fault::range_lost, now.ns);
  was_gone_ = true;
  if (std::exchange(told_, true)) return;
  const Stamp frame{state_.last_stamp_ns.load(std::memory_order_relaxed)};
  queues_.notices.push(Notice::make(Notice::Kind::fault, frame, name_of(Fault::range_lost), sensor_.error()));
}

void RangeStage::work() {
  const heap_guard::Scope armed;
  Status status = listen(now_stamp());
  const Stamp now = now_stamp();
  if (status == Status::ok) status = drive_stop_line(now);
  if (status == Status::ok)
    note_state(now);
  else
    give_up_for_a_while(now);
}

/// Until the next edge, or until something is due.
Status RangeStage::listen(Stamp now) {
  if (const auto silence = ranger_.take_silence(now)) hand_on(*silence);
  if (ranger_.wants_trigger(now)) {
    Stamp at;
    if (const Status status = sensor_.trigger(at); status != Status::ok) return status;
    ranger_.triggered(at);
  }
  const int64_t wait_ns = std::min(ranger_.next_due(now).ns - now.ns, kWait_ns);
  EchoEdge edge;
  // Rounded up: a wait of nothing, again and again, is a busy one.
  const auto wait_ms = static_cast<int32_t>((wait_ns + kMillisecond_ns - 1) / kMillisecond_ns);
  const Status status = sensor_.next_edge(edge, wait_ms);
  if (status == Status::timeout) return Status::ok;
  if (status != Status::ok) return status;
  next_wait_ns_ = 0;
  told_ = false;
  take_a_rest(edge.stamp);
  if (const auto reading = ranger_.take(edge)) hand_on(*reading);
  return Status::ok;
}

/// A line that does nothing but change must not take all the time of a processor.
void RangeStage::take_a_rest(Stamp edge) {
  if (edge.ns - window_ns_ > kWait_ns) {
    window_ns_ = edge.ns;
    edges_ = 0;
  }
  if (++edges_ > kMostEdges) std::this_thread::sleep_for(kRest);
}

void RangeStage::hand_on(const RangeReading& reading) {
  // All three are tried: one reader that is behind is no reason to leave the others out.
  const bool to_loop = queues_.to_loop.push(reading), to_publish = queues_.to_publish.push(reading),
             to_record = queues_.to_record.push(reading);
  to_publish_.wake();
  if (to_loop && to_publish && to_record) return;
  state_.results_dropped.fetch_add(1, std::memory_order_relaxed);
  state_.faults.raise(Fault::result_dropped, monotonic_ns());
}

void RangeStage::note_state(Stamp now) {
  const auto hold = [&](Fault fault, bool holds) {
    if (holds)
      state_.faults.hold(fault, now.ns);
    else
      state_.faults.clear(fault);
  };
  hold(Fault::range_lost, ranger_.lost(now));
  hold(Fault::range_stuck, ranger_.stuck(now));
}

Status RangeStage::drive_stop_line(Stamp now) {
  const bool high = ranger_.stop_line(now);
  if (high == line_high_) return Status::ok;
  line_high_ = high;
  return sensor_.set_stop(high);
}

}  // namespace stillmap
