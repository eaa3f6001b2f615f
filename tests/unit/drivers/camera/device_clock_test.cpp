#include "drivers/camera/device_clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>

#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr int64_t kClockMs = 1'000'000, kClockS = 1'000'000'000;
constexpr int64_t kFrameNs = 33'333'333;
constexpr int64_t kBoot = 12'345 * kClockS;  ///< when the device's clock began

/// A camera whose clock runs `drift` too slowly, and the computer that it sends frames to.
struct Camera {
  double drift = 0;
  std::function<int64_t(int)> delay_ns = [](int) { return 2 * kClockMs; };
  int64_t shift_ns = 0;  ///< somebody set the device's clock

  int64_t taken_ns(int i) const { return kBoot + i * kFrameNs; }
  int64_t device_ns(int i) const {
    return std::llround(static_cast<double>(i * kFrameNs) * (1 - drift)) + shift_ns;
  }
  DeviceClock::Mapped send(DeviceClock& clock, int i) const {
    return clock.map(device_ns(i), taken_ns(i) + delay_ns(i));
  }
};

/// Largest error from frame `from` on, the smallest delay taken as known.
int64_t worst_ns(const Camera& camera, DeviceClock& clock, int from, int to, int64_t least_delay_ns) {
  int64_t worst = 0, last = INT64_MIN;
  for (int i = 0; i < to; ++i) {
    const auto mapped = camera.send(clock, i);
    EXPECT_FALSE(mapped.jumped) << i;
    EXPECT_GT(mapped.monotonic_ns, last) << i;
    EXPECT_LE(mapped.monotonic_ns, camera.taken_ns(i) + camera.delay_ns(i)) << i;
    last = mapped.monotonic_ns;
    if (i >= from)
      worst = std::max(worst, std::abs(mapped.monotonic_ns - camera.taken_ns(i) - least_delay_ns));
  }
  return worst;
}

TEST(DeviceClock, FindsTheOffset) {
  DeviceClock clock;
  EXPECT_EQ(worst_ns({}, clock, 0, 300, 2 * kClockMs), 0);
  EXPECT_EQ(clock.jumps(), 0u);
}

TEST(DeviceClock, IsNotMovedByLateFrames) {
  std::mt19937 random(3);
  Camera camera;
  std::vector<int64_t> delays(3000);
  for (int64_t& delay : delays) delay = 2 * kClockMs + static_cast<int64_t>(random() % 30) * kClockMs;
  for (size_t i = 1000; i < 1060; ++i) delays[i] += 40 * kClockMs;  // two seconds of load
  camera.delay_ns = [&](int i) { return delays[static_cast<size_t>(i)]; };
  DeviceClock clock;
  EXPECT_LT(worst_ns(camera, clock, 300, 3000, 2 * kClockMs), 2 * kClockMs);
  EXPECT_EQ(clock.jumps(), 0u);
}

TEST(DeviceClock, FollowsDrift) {
  for (const double drift : {80e-6, -80e-6, 300e-6}) {
    std::mt19937 random(5);
    Camera camera;
    camera.drift = drift;
    std::vector<int64_t> delays(9000);  // five minutes
    for (int64_t& delay : delays) delay = 2 * kClockMs + static_cast<int64_t>(random() % 8'000'000);
    camera.delay_ns = [&](int i) { return delays[static_cast<size_t>(i)]; };
    DeviceClock clock;
    EXPECT_LT(worst_ns(camera, clock, 600, 9000, 2 * kClockMs), 2 * kClockMs) << drift;
    EXPECT_NEAR(clock.drift(), drift, 30e-6);
    EXPECT_EQ(clock.jumps(), 0u);
  }
}

TEST(DeviceClock, NoticesThatTheClockWasSet) {
  for (const int64_t shift : {10 * kClockS, -10 * kClockS, 100 * kClockMs, -100 * kClockMs}) {
    Camera camera;
    DeviceClock clock;
    for (int i = 0; i < 200; ++i) camera.send(clock, i);
    camera.shift_ns = shift;
    const auto mapped = camera.send(clock, 200);
    EXPECT_TRUE(mapped.jumped) << shift;
    EXPECT_EQ(mapped.monotonic_ns, camera.taken_ns(200) + 2 * kClockMs);
    for (int i = 201; i < 400; ++i) {
      const auto after = camera.send(clock, i);
      EXPECT_FALSE(after.jumped);
      EXPECT_EQ(after.monotonic_ns, camera.taken_ns(i) + 2 * kClockMs) << shift;
    }
    EXPECT_EQ(clock.jumps(), 1u);
  }
}

/// Set back by less than the time between two frames: only that all of them are late from then on shows it.
TEST(DeviceClock, NoticesASmallStepBack) {
  Camera camera;
  camera.delay_ns = [](int) { return 0; };
  DeviceClock clock;
  for (int i = 0; i < 200; ++i) clock.map(camera.device_ns(i) * 2, camera.taken_ns(i) * 2);
  camera.shift_ns = -30 * kClockMs;  // 60 ms at a frame every 67 ms
  for (int i = 200; i < 260; ++i) clock.map(camera.device_ns(i) * 2, camera.taken_ns(i) * 2);
  EXPECT_EQ(clock.jumps(), 1u);
}

TEST(DeviceClock, AStalledReaderIsNoJump) {
  Camera camera;
  camera.delay_ns = [](int i) { return i < 100 || i >= 110 ? 0 : (110 - i) * kFrameNs; };
  DeviceClock clock;
  EXPECT_EQ(worst_ns(camera, clock, 0, 300, 0), 0);
  EXPECT_EQ(clock.jumps(), 0u);
}

TEST(DeviceClock, AFirstFrameThatIsLateIsNoJump) {
  Camera camera;
  camera.delay_ns = [](int i) { return i == 0 ? 400 * kClockMs : 2 * kClockMs; };
  DeviceClock clock;
  camera.send(clock, 0);
  int64_t last = 0;
  for (int i = 13; i < 100; ++i) {  // those between came while it was on its way
    const auto mapped = camera.send(clock, i);
    EXPECT_FALSE(mapped.jumped) << i;
    EXPECT_EQ(mapped.monotonic_ns, camera.taken_ns(i) + 2 * kClockMs);
    EXPECT_GT(mapped.monotonic_ns, last);
    last = mapped.monotonic_ns;
  }
  EXPECT_EQ(clock.jumps(), 0u);
}

TEST(DeviceClock, GoesOnRisingWhenTheDeviceIsOpenedAgain) {
  Camera camera;
  camera.delay_ns = [](int) { return 20 * kClockMs; };
  DeviceClock clock;
  int64_t last = 0;
  for (int i = 0; i < 100; ++i) last = camera.send(clock, i).monotonic_ns;
  clock.restart();
  camera.shift_ns = -camera.device_ns(100);  // its clock starts at 0 again
  for (int i = 100; i < 200; ++i) {
    const auto mapped = camera.send(clock, i);
    EXPECT_FALSE(mapped.jumped);
    EXPECT_GT(mapped.monotonic_ns, last);
    last = mapped.monotonic_ns;
  }
  EXPECT_EQ(clock.jumps(), 0u);
}

TEST(DeviceClock, SurvivesAnyStamps) {
  std::mt19937_64 random(11);
  DeviceClock clock;
  int64_t last = INT64_MIN, arrived = kBoot;
  for (int i = 0; i < 20000; ++i) {
    arrived += static_cast<int64_t>(random() % 50) * kClockMs + 1;
    const auto device = static_cast<int64_t>(random() % (1ull << (random() % 62)));
    const auto mapped = clock.map(device, arrived);
    EXPECT_GT(mapped.monotonic_ns, last);
    EXPECT_LE(mapped.monotonic_ns, arrived);
    last = mapped.monotonic_ns;
  }
  EXPECT_GT(clock.jumps(), 100u);
}

TEST(DeviceClock, DoesNotAllocate) {
  const uint64_t before = heap_guard::allocations();
  {
    const heap_guard::Scope armed;
    DeviceClock clock;
    for (int i = 0; i < 3000; ++i) clock.map(i * kFrameNs, kBoot + i * kFrameNs + (i % 7) * kClockMs);
  }
  EXPECT_EQ(heap_guard::allocations(), before);
}

}  // namespace
}  // namespace stillmap
