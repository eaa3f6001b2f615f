#include "runtime/executive/capture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "runtime/core/clock.hpp"
#include "runtime/record/trajectory_writer.hpp"

namespace stillmap {
namespace {

constexpr std::chrono::milliseconds kWait{100};  ///< how long a stop may go unseen
constexpr uint32_t kNotices = 64;                ///< on their way to the log; more are only counted

}  // namespace

Capture::Capture(FrameSource& source, FrameSlots& slots, FrameMailbox& mailbox, RunState& state,
                 CaptureLimits limits)
    : source_(source), slots_(slots), mailbox_(mailbox), state_(state), limits_(limits), notices_(kNotices) {}

void Capture::run() {
  uint32_t slot = 0;
  bool have_slot = false;
  uint32_t read = 0;
  state_.last_frame_ns.store(monotonic_ns(), std::memory_order_relaxed);
  while (!state_.stop.load(std::memory_order_relaxed) &&
         (limits_.max_frames == 0 || read < limits_.max_frames)) {
    state_.capture.beat();
    if (!have_slot) have_slot = slots_.acquire(slot, kWait);
    if (!have_slot) continue;
    slots_[slot].frame().captured = {};
    const Status status = source_.next_unfinished(slots_[slot].frame(), static_cast<int32_t>(kWait.count()));
    if (gone(status)) {
      wait_for_camera();
      continue;
    }
    if (status == Status::timeout) continue;
    if (status == Status::end) break;
    if (status != Status::ok && status != Status::bad_data) {
      error_ = source_.error();
      state_.faults.hold(Fault::camera_gone, monotonic_ns());
      break;
    }
    ++read;
    state_.frames_read.fetch_add(1, std::memory_order_relaxed);
    state_.last_frame_ns.store(monotonic_ns(), std::memory_order_relaxed);
    if (status == Status::bad_data)
      pass_over(source_.error());
    else
      have_slot = !deliver(slot);
  }
  if (have_slot) slots_.release(slot);
  ended_.store(true, std::memory_order_release);
}

/// A camera that may come back.
bool Capture::gone(Status status) const {
  if (!source_.live() || (status != Status::unavailable && status != Status::timeout)) return false;
  const int64_t silent_ns = monotonic_ns() - state_.last_frame_ns.load(std::memory_order_relaxed);
  return status == Status::unavailable || static_cast<double>(silent_ns) * 1e-9 >= limits_.gone_s;
}

/// Opens it again until it is there, or a stop is asked for. The map stays; the pose is lost until it is
/// found in it.
void Capture::wait_for_camera() {
  const int64_t since_ns = monotonic_ns();
  state_.faults.hold(Fault::camera_gone, since_ns);
  say(Notice::Kind::fault,
      source_.error().empty() ? fmt::format("no frame for {} s", limits_.gone_s) : source_.error());
  double wait_s = limits_.reopen_s;
  while (source_.reopen() != Status::ok) {
    if (!pause(wait_s)) return;
    wait_s = std::min(2 * wait_s, limits_.reopen_max_s);
  }
  const int64_t now_ns = monotonic_ns();
  state_.faults.clear(Fault::camera_gone);
  state_.last_frame_ns.store(now_ns, std::memory_order_relaxed);
  say(Notice::Kind::info, fmt::format("back after {:.1f} s", static_cast<double>(now_ns - since_ns) * 1e-9));
}

/// @return false: a stop was asked for
bool Capture::pause(double seconds) {
  const int64_t until_ns = monotonic_ns() + static_cast<int64_t>(seconds * 1e9);
  while (!state_.stop.load(std::memory_order_relaxed)) {
    state_.capture.beat();
    const int64_t left_ns = until_ns - monotonic_ns();
    if (left_ns <= 0) return true;
    std::this_thread::sleep_for(std::min<std::chrono::nanoseconds>(kWait, std::chrono::nanoseconds(left_ns)));
  }
  return false;
}

void Capture::say(Notice::Kind kind, const std::string& text) {
  notices_.push(Notice::make(kind, last_, name_of(Fault::camera_gone), text));
}

/// @return whether the slot went on
bool Capture::deliver(uint32_t slot) {
  RgbdFrame& frame = slots_[slot].frame();
  // Stamps have to rise: what comes after (files, filters) relies on it.
  if (jumps_back(frame)) {
    pass_over(fmt::format("frame {}: stamp {} is not later than the one before it, {}", frame.sequence,
                          file_stamp(frame.depth_stamp), file_stamp(last_)));
    return false;
  }
  last_ = frame.depth_stamp;
  state_.last_stamp_ns.store(last_.ns, std::memory_order_relaxed);
  ++delivered_;
  if (frame.captured.ns == 0) frame.captured.ns = monotonic_ns();
  mailbox_.put(slot);
  uint32_t dropped = source_.left_out() - left_out_;
  for (int32_t older; (older = mailbox_.crowded_out()) != FrameMailbox::kEmpty; ++dropped)
    slots_.release(static_cast<uint32_t>(older));
  count_dropped(dropped);
  left_out_ = source_.left_out();
  return true;
}

void Capture::count_dropped(uint32_t frames) {
  if (frames == 0) return;
  state_.frames_dropped.fetch_add(frames, std::memory_order_relaxed);
  state_.faults.raise(Fault::frame_dropped, monotonic_ns(), frames);
}

void Capture::pass_over(const std::string& why) {
  state_.faults.raise(Fault::bad_frame, monotonic_ns());
  notices_.push(Notice::make(Notice::Kind::fault, last_, name_of(Fault::bad_frame), why));
}

}  // namespace stillmap
