#include "runtime/executive/frame_loop.hpp"

#include <algorithm>

#include "runtime/core/clock.hpp"
#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr std::chrono::milliseconds kWait{100};  ///< how long a stop may go unseen
constexpr uint32_t kStartFrames = 30;  ///< by then what waited for the first one is done, or never will be

void copy_mask(ImageView<const uint8_t> from, ImageView<uint8_t> to) {
  for (int32_t row = 0; row < to.rows; ++row) std::copy_n(from.row(row), to.cols, to.row(row));
}

uint64_t given_up(const MapHealth& m) {
  return m.dropped_blocks + m.table_full + m.pool_empty;
}

}  // namespace

void FrameLoop::run() {
  while (!p_.state.stop.load(std::memory_order_relaxed)) {
    p_.state.real_time.beat();
    take_ranges();
    // Asked before the look into the mailbox: what was put there before the end is found.
    const bool ended = p_.capture.ended();
    const int32_t slot = p_.mailbox.take(ended ? std::chrono::milliseconds(0) : kWait);
    if (slot != FrameMailbox::kEmpty)
      work_on(static_cast<uint32_t>(slot));
    else if (ended)
      break;
  }
  const heap_guard::Scope armed;
  p_.pipeline.finish();
}

void FrameLoop::work_on(uint32_t slot) {
  RgbdFrame& frame = p_.slots[slot].frame();
  FrameResult result;
  {
    const heap_guard::Scope armed;
    const float finish_ms = finish(frame);
    FrameWork work = work_for(frame);
    work.finish_ms = finish_ms;
    decide(frame, work);
    if (p_.odometry) p_.odometry->begin_frame();
    result = p_.pipeline.process(frame, work, this);
    if (p_.odometry) p_.odometry->log(decision_);
    if (p_.archive) decision_.archive_answers = p_.archive->step(p_.engine, p_.pipeline.centre_map());
    if (limits_.live) count_lateness(result, work);
    note_faults(result);
    note_discontinuity();
    publish(result, true, p_.state.pose_epoch.load(std::memory_order_relaxed));
  }
  for (FrameObserver* observer : p_.observers) observer->see(frame, result, p_.engine);
  const heap_guard::Scope armed;
  hand_on(slot, result);
  keep_map(result);
  obey_requests(result.stamp);
  last_ = result;
  ++frames_;
  if (frames_ >= kStartFrames || p_.mailbox.empty()) p_.mailbox.newest_wins();
}

/// Also while no frame comes: the queue is short.
void FrameLoop::take_ranges() {
  if (p_.ranges == nullptr) return;
  for (RangeReading reading; p_.ranges->pop(reading);) ranges_.add(reading);
}

/// @return the time it took
float FrameLoop::finish(RgbdFrame& frame) const {
  const int64_t start_ns = monotonic_ns();
  p_.capture.finish(frame);
  return static_cast<float>(monotonic_ns() - start_ns) * 1e-6f;
}

FrameWork FrameLoop::work_for(const RgbdFrame& frame) {
  FrameWork work;
  if (limits_.live) work = {load_.integrate(), load_.finest_level()};
  take_ranges();
  work.sonar_m = frame.sonar_m > 0 ? frame.sonar_m : ranges_.at(frame.captured);
  return work;
}

/// What a replay has to know of this frame.
void FrameLoop::decide(const RgbdFrame& frame, const FrameWork& work) {
  const bool new_map = decision_.new_map;
  decision_ = {};
  decision_.sequence = frame.sequence;
  decision_.used = true;
  decision_.shed = load_.shed();
  decision_.integrated = work.integrate;
  decision_.sonar_m = work.sonar_m;
  decision_.new_map = new_map;
}

/// The camera's period by the stamps: the shortest so far, since frames may have been skipped.
double FrameLoop::period_ms(Stamp stamp) {
  if (limits_.period_ms > 0) return limits_.period_ms;
  const double step_ms = frames_ == 0 ? 0 : static_cast<double>(stamp.ns - last_.stamp.ns) * 1e-6;
  if (step_ms > 0) shortest_ms_ = shortest_ms_ > 0 ? std::min(shortest_ms_, step_ms) : step_ms;
  return shortest_ms_;
}

void FrameLoop::count_lateness(const FrameResult& result, const FrameWork& work) {
  const double period = period_ms(result.stamp);
  const auto total_ms = static_cast<double>(result.ms.total_ms);
  if (period > 0 && total_ms > period) {
    p_.state.deadline_misses.fetch_add(1, std::memory_order_relaxed);
    p_.state.faults.raise(Fault::deadline_missed, monotonic_ns());
  }
  load_.add(total_ms, work.integrate, period);
  p_.state.shed.store(static_cast<uint8_t>(load_.shed()), std::memory_order_relaxed);
  if (load_.shed() == Shed::nothing)
    p_.state.faults.clear(Fault::work_shed);
  else
    p_.state.faults.hold(Fault::work_shed, monotonic_ns());
}

void FrameLoop::note_faults(const FrameResult& result) {
  FaultBoard& faults = p_.state.faults;
  const int64_t now_ns = monotonic_ns();
  if (result.status == Status::bad_data) faults.raise(Fault::bad_frame, now_ns);
  if (result.state == TrackingState::lost)
    faults.hold(Fault::tracking_lost, now_ns);
  else
    faults.clear(Fault::tracking_lost);
  if (result.odometry_stale)
    faults.hold(Fault::odometry_stale, now_ns);
  else
    faults.clear(Fault::odometry_stale);
  if (given_up(result.map) > given_up(last_.map)) faults.raise(Fault::map_full, now_ns);
}

void FrameLoop::note_discontinuity() {
  const PipelineCounters& now = p_.pipeline.counters();
  if (now.relocalised == relocalised_) return;
  relocalised_ = now.relocalised;
  p_.state.pose_epoch.fetch_add(1, std::memory_order_relaxed);
}

void FrameLoop::pose_known(const FrameResult& result) {
  // The pose of a frame that ends the search for the camera is the first of the next epoch.
  const bool found_again = p_.pipeline.was_lost();
  publish(result, false, p_.state.pose_epoch.load(std::memory_order_relaxed) + (found_again ? 1 : 0));
}

void FrameLoop::publish(const FrameResult& result, bool whole, uint32_t pose_epoch) {
  if (!p_.to_publish.push({result, whole, pose_epoch, p_.state.map_id.load(std::memory_order_relaxed)}))
    count_dropped_result();
}

void FrameLoop::count_dropped_result() {
  p_.state.results_dropped.fetch_add(1, std::memory_order_relaxed);
  p_.state.faults.raise(Fault::result_dropped, monotonic_ns());
}

void FrameLoop::keep_map(const FrameResult& result) {
  if (p_.map_keeper) {
    const RunEvent event = p_.map_keeper->step(result);
    if (event.kind == RunEvent::Kind::map_saved) p_.state.saves.store(kSaveDone, std::memory_order_release);
    if (event.kind == RunEvent::Kind::map_save_failed)
      p_.state.saves.store(kSaveFailed, std::memory_order_release);
    tell(event);
  }
  if (limits_.new_map_after_s > 0 && p_.pipeline.lost_s() >= limits_.new_map_after_s)
    if (!p_.map_keeper || p_.map_keeper->map_may_go()) give_up_map(result.stamp);
}

/// A camera that was not found again for long: what it sees now is all there is to go by. Waits until the
/// old map is in its file, where one is asked for.
void FrameLoop::give_up_map(Stamp stamp) {
  RunEvent event;
  event.kind = RunEvent::Kind::new_map;
  event.stamp = stamp;
  event.seconds = p_.pipeline.lost_s();
  p_.state.faults.raise(Fault::new_map, monotonic_ns());
  start_new_map(event);
}

void FrameLoop::start_new_map(const RunEvent& why) {
  tell(why);
  decision_.new_map = true;  // of the frame that comes next
  p_.pipeline.start_new_map();
  if (p_.archive) p_.archive->forget();
  p_.state.pose_epoch.fetch_add(1, std::memory_order_relaxed);
  p_.state.map_id.fetch_add(1, std::memory_order_relaxed);
}

void FrameLoop::obey_requests(Stamp stamp) {
  const uint32_t requests = p_.state.requests.exchange(0, std::memory_order_acq_rel);
  if ((requests & kSaveMapRequest) != 0 && p_.map_keeper) p_.map_keeper->save_soon();
  if ((requests & kResetRequest) == 0) return;
  RunEvent event;
  event.kind = RunEvent::Kind::reset;
  event.stamp = stamp;
  start_new_map(event);
}

void FrameLoop::hand_on(uint32_t slot, const FrameResult& result) {
  RunItem item;
  item.has_frame = true;
  item.result = result;
  item.truth_T_world_cam = p_.slots[slot].frame().truth_T_world_cam;
  item.decision = decision_;
  decision_.new_map = false;
  item.pose_epoch = p_.state.pose_epoch.load(std::memory_order_relaxed);
  item.map_id = p_.state.map_id.load(std::memory_order_relaxed);
  item.counters = p_.pipeline.counters();
  if (p_.archive) item.archive = p_.archive->counters();
  // Not live, the only slot always goes on and comes back when the frame is on disk: nothing is lost. Live,
  // one has to stay free for the camera.
  const bool room = p_.slots.in_use() < p_.slots.count();
  const bool with_images = !limits_.live || (limits_.keep_images && room);
  if (with_images) {
    item.slot = static_cast<int32_t>(slot);
    if (limits_.keep_images && result.status != Status::bad_data)
      copy_mask(p_.engine.mask_image(), p_.slots[slot].mask());
  }
  const bool taken = p_.to_record.push(item);
  if (!taken || !with_images) p_.slots.release(slot);
  if (taken && (with_images || !limits_.keep_images)) return;
  count_dropped_result();
}

void FrameLoop::tell(const RunEvent& event) {
  if (event.kind == RunEvent::Kind::none) return;
  RunItem item;
  item.event = event;
  if (!p_.to_record.push(item)) count_dropped_result();
}

}  // namespace stillmap
