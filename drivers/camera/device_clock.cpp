#include "drivers/camera/device_clock.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// @param count 1 or more; their order is lost
template <class T>
T median(T* values, size_t count) {
  T* const middle = values + count / 2;
  std::nth_element(values, middle, values + count);
  return *middle;
}

}  // namespace

DeviceClock::Mapped DeviceClock::map(int64_t device_ns, int64_t arrived_ns) {
  const Least sample = {device_ns, arrived_ns - device_ns};
  Mapped mapped;
  if (!started_) {
    start(sample);
  } else if (jumped(device_ns, sample.offset_ns - offset_at(device_ns))) {
    mapped.jumped = true;
    jumps_.fetch_add(1, std::memory_order_relaxed);
    start(sample);
  } else {
    add(sample);
  }
  last_device_ns_ = device_ns;
  const int64_t taken_ns = std::min(device_ns + offset_at(device_ns), arrived_ns);
  mapped.monotonic_ns = std::max(taken_ns, last_mapped_ns_ == INT64_MIN ? taken_ns : last_mapped_ns_ + 1);
  last_mapped_ns_ = mapped.monotonic_ns;
  return mapped;
}

void DeviceClock::start(Least sample) {
  started_ = true;
  late_frames_ = 0;
  window_start_ns_ = sample.device_ns;
  least_ = line_ = sample;
  windows_over_ = 0;
  drift_.store(0, std::memory_order_relaxed);
}

/// A frame cannot arrive before it was taken; it can be late, but not all of them for long.
bool DeviceClock::jumped(int64_t device_ns, int64_t residual_ns) {
  late_frames_ = residual_ns > kJumpNs ? late_frames_ + 1 : 0;
  // What came first may itself have been late.
  const int64_t too_early_ns = windows_over_ == 0 ? -kWindowNs : -kJumpNs;
  return device_ns <= last_device_ns_ || residual_ns < too_early_ns || late_frames_ >= kLateFrames;
}

void DeviceClock::add(Least sample) {
  if (sample.device_ns - window_start_ns_ >= kWindowNs) {
    windows_[windows_over_++ % kWindows] = least_;
    fit_line();
    window_start_ns_ = sample.device_ns;
    least_ = sample;
  } else if (sample.offset_ns < least_.offset_ns) {
    least_ = sample;
  }
  // Too little is known for a line: the least delay so far.
  if (windows_over_ < 3 && sample.offset_ns < line_.offset_ns) line_ = sample;
}

void DeviceClock::fit_line() {
  const uint32_t count = std::min(windows_over_, kWindows);
  if (count < 3) return;
  std::array<double, kWindows*(kWindows - 1) / 2> slopes;
  size_t pairs = 0;
  for (uint32_t i = 0; i < count; ++i)
    for (uint32_t k = 0; k < i; ++k)
      slopes[pairs++] = static_cast<double>(windows_[i].offset_ns - windows_[k].offset_ns) /
                        static_cast<double>(windows_[i].device_ns - windows_[k].device_ns);
  const double drift = std::clamp(median(slopes.data(), pairs), -kMostDrift, kMostDrift);
  drift_.store(drift, std::memory_order_relaxed);

  line_.device_ns = windows_[(windows_over_ - 1) % kWindows].device_ns;
  std::array<int64_t, kWindows> offsets;
  for (uint32_t i = 0; i < count; ++i)
    offsets[i] = windows_[i].offset_ns +
                 std::llround(drift * static_cast<double>(line_.device_ns - windows_[i].device_ns));
  line_.offset_ns = median(offsets.data(), count);
}

int64_t DeviceClock::offset_at(int64_t device_ns) const {
  return line_.offset_ns + std::llround(drift() * static_cast<double>(device_ns - line_.device_ns));
}

}  // namespace stillmap
