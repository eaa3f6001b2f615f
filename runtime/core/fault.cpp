#include "runtime/core/fault.hpp"

namespace stillmap {
namespace {

constexpr std::array<std::string_view, kFaults> kNames = {
    "bad_frame",       "camera_stalled",  "camera_gone",     "tracking_lost",    "new_map",
    "map_full",        "archive_full",    "archive_failed",  "record_failed",    "log_full",
    "frame_dropped",   "result_dropped",  "deadline_missed", "work_shed",        "clock_jump",
    "bus_unavailable", "foreign_message", "odometry_stale",  "realtime_refused", "heap_used",
    "device_failed",   "thread_stalled",  "range_lost",      "range_stuck"};
static_assert(static_cast<uint32_t>(Fault::range_stuck) + 1 == kFaults);

constexpr uint64_t bit(Fault fault) {
  return uint64_t{1} << static_cast<uint32_t>(fault);
}

}  // namespace

std::string_view name_of(Fault fault) {
  return kNames[static_cast<size_t>(fault)];
}

void FaultBoard::raise(Fault fault, int64_t now_ns, uint32_t times) {
  Cell& cell = cells_[static_cast<size_t>(fault)];
  if (cell.count.fetch_add(times, std::memory_order_relaxed) == 0)
    cell.first_ns.store(now_ns, std::memory_order_relaxed);
  cell.last_ns.store(now_ns, std::memory_order_relaxed);
  latched_.fetch_or(bit(fault), std::memory_order_relaxed);
}

void FaultBoard::hold(Fault fault, int64_t now_ns) {
  if ((active_.fetch_or(bit(fault), std::memory_order_relaxed) & bit(fault)) == 0) raise(fault, now_ns);
}

void FaultBoard::clear(Fault fault) {
  active_.fetch_and(~bit(fault), std::memory_order_relaxed);
}

FaultBoard::Entry FaultBoard::entry(Fault fault) const {
  const Cell& cell = cells_[static_cast<size_t>(fault)];
  return {cell.count.load(std::memory_order_relaxed), cell.first_ns.load(std::memory_order_relaxed),
          cell.last_ns.load(std::memory_order_relaxed)};
}

}  // namespace stillmap
