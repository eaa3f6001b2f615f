#include "runtime/core/clock.hpp"

#include <time.h>

#include <algorithm>
#include <cstdlib>

namespace stillmap {
namespace {

int64_t read_ns(clockid_t id) {
  timespec t{};
  clock_gettime(id, &t);
  return int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

}  // namespace

int64_t monotonic_ns() {
  return read_ns(CLOCK_MONOTONIC);
}

int64_t wall_ns() {
  return read_ns(CLOCK_REALTIME);
}

UtcClock::UtcClock() : followed_ns_(monotonic_ns()) {
  offset_ns_ = wall_ns() - followed_ns_;
}

bool UtcClock::follow(int64_t now_monotonic_ns, int64_t now_wall_ns) {
  const int64_t error_ns = now_wall_ns - now_monotonic_ns - offset_ns_.load(std::memory_order_relaxed);
  const int64_t passed_ns = now_monotonic_ns - followed_ns_;
  followed_ns_ = now_monotonic_ns;
  const bool step = std::abs(error_ns) > kStepNs;
  const auto most_ns = static_cast<int64_t>(kSlew * static_cast<double>(passed_ns));
  offset_ns_.fetch_add(step ? error_ns : std::clamp(error_ns, -most_ns, most_ns), std::memory_order_relaxed);
  return step;
}

}  // namespace stillmap
