// The sonar's driver and its thread on the kernel's simulated GPIO chip (gpio-sim). Runs in the virtual
// machine: vm_sonar.sh makes the chip "sonar" with the lines 0 trigger, 1 echo, 2 stop, and names its places:
//   sonar_kernel_test CHIP_DEVICE SYSFS GPIO_SIM_SH [--gtest_...]     the tests
//   sonar_kernel_test --pulses SYSFS WIDTH_US SECONDS                 only is a pulse width sensor

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "drivers/gpio/gpio_sonar.hpp"
#include "runtime/core/clock.hpp"
#include "runtime/executive/range_stage.hpp"
#include "tests/support/contains.hpp"

namespace stillmap {
namespace {

std::string g_chip, g_sysfs, g_gpio_sim;

constexpr int64_t kUs = 1'000, kMs = 1'000'000, kSecond = 1'000'000'000;

void sleep_ns(int64_t ns) {
  std::this_thread::sleep_for(std::chrono::nanoseconds(ns));
}

/// One line of the simulated chip, from the side of what is wired to it.
class Wire {
 public:
  Wire(const std::string& sysfs, int line, const char* attribute, int flags)
      : fd_(open((sysfs + "/sim_gpio" + std::to_string(line) + "/" + attribute).c_str(), flags)) {}
  ~Wire() {
    if (fd_ >= 0) close(fd_);
  }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  /// @return -1: the chip is gone
  int level() const {
    char text = 0;
    return pread(fd_, &text, 1, 0) == 1 ? text - '0' : -1;
  }
  void pull(bool up) const {
    const char* text = up ? "pull-up" : "pull-down";
    if (pwrite(fd_, text, std::strlen(text), 0) < 0 && errno != ENODEV) std::perror("pull");
  }

 private:
  const int fd_;
};

int stop_level() {
  return Wire(g_sysfs, 2, "value", O_RDONLY).level();
}

/// What an HC-SR04 does: an echo of `width_us` to each trigger; 0: nothing.
class Echoes {
 public:
  Echoes(const std::string& sysfs, int64_t first_width_us)
      : width_us(first_width_us), thread_([this, sysfs] { run(sysfs); }) {}
  ~Echoes() {
    stop_ = true;
    thread_.join();
  }

  std::atomic<int64_t> width_us;

 private:
  void run(const std::string& sysfs) {
    const Wire trigger(sysfs, 0, "value", O_RDONLY), echo(sysfs, 1, "pull", O_WRONLY);
    echo.pull(false);
    while (!stop_) {
      // A pulse of some ten microseconds is seen by looking all the time only; whoever wants to work may.
      if (trigger.level() != 1) {
        sched_yield();
        continue;
      }
      while (trigger.level() == 1 && !stop_) sched_yield();
      if (width_us == 0) continue;
      sleep_ns(300 * kUs);
      echo.pull(true);
      sleep_ns(width_us * kUs);
      echo.pull(false);
    }
  }

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// What a sensor that needs no trigger does, twenty times a second.
void pulse(const Wire& echo, int64_t width_us) {
  echo.pull(true);
  sleep_ns(width_us * kUs);
  echo.pull(false);
  sleep_ns(50 * kMs - width_us * kUs);
}

SonarConfig hc_sr04() {
  SonarConfig sonar;
  sonar.kind = SonarKind::hc_sr04;
  sonar.chip = g_chip;
  sonar.trigger_line = 0;
  sonar.echo_line = 1;
  sonar.stop_line = 2;
  sonar.rate_hz = 20;
  sonar.lost_s = 0.5f;
  sonar.stuck_s = 0.5f;
  return sonar;
}

/// The sonar's thread as it is in the program.
class Running {
 public:
  explicit Running(const SonarConfig& sonar)
      : sensor_(std::move(*make_gpio_sonar(sonar))), stage_(*sensor_, sonar, queues, published_, state) {
    thread_ = std::thread([this] { stage_.run(); });
  }
  ~Running() { stop(); }
  void stop() {
    state.stop = true;
    if (thread_.joinable()) thread_.join();
  }

  bool holds(Fault fault) const { return (state.faults.active() >> static_cast<uint32_t>(fault) & 1) != 0; }
  /// Readings until `ns` from now.
  std::vector<RangeReading> listen(int64_t ns) {
    std::vector<RangeReading> all;
    const int64_t until_ns = monotonic_ns() + ns;
    RangeReading reading;
    while (monotonic_ns() < until_ns)
      if (queues.to_record.pop_within(reading, std::chrono::milliseconds(10))) all.push_back(reading);
    return all;
  }
  template <class Condition>
  bool within(int64_t ns, Condition condition) const {
    for (const int64_t until_ns = monotonic_ns() + ns; monotonic_ns() < until_ns; sleep_ns(5 * kMs))
      if (condition()) return true;
    return condition();
  }

  RunState state;
  RangeQueues queues;

 private:
  PublishQueue published_{4};
  std::unique_ptr<RangeSensor> sensor_;
  RangeStage stage_;
  std::thread thread_;
};

float metres(int64_t width_us) {
  return 0.5e-6f * static_cast<float>(width_us) * speed_of_sound(20);
}

TEST(SonarOnGpioSim, MeasuresWhatTheEchoSays) {
  for (const int64_t width_us : {2000, 5800, 20000}) {
    Echoes echoes(g_sysfs, width_us);
    Running sonar(hc_sr04());
    const std::vector<RangeReading> readings = sonar.listen(kSecond);
    ASSERT_GE(readings.size(), 15u) << width_us;
    size_t valid = 0;
    float least = 100, most = 0;
    for (const RangeReading& reading : readings) {
      if (!reading.valid) continue;
      ++valid;
      least = std::min(least, reading.range_m), most = std::max(most, reading.range_m);
      // The echo's own sleep takes some 160 us longer than it asks for.
      EXPECT_GE(reading.range_m, metres(width_us));
      EXPECT_LE(reading.range_m, metres(width_us + 400));
      EXPECT_EQ(reading.stop, reading.range_m < 0.25f);
    }
    EXPECT_GE(4 * valid, 3 * readings.size()) << "the one that answers may miss a trigger";
    std::printf("echo of %ld us: %zu readings, %zu valid, %.4f to %.4f m\n", static_cast<long>(width_us),
                readings.size(), valid, static_cast<double>(least), static_cast<double>(most));
    EXPECT_FALSE(sonar.holds(Fault::range_lost));
    EXPECT_FALSE(sonar.holds(Fault::range_stuck));
  }
}

TEST(SonarOnGpioSim, TheStopLineSaysStopAtOnceAndAtTheEnd) {
  Echoes echoes(g_sysfs, 8000);
  Running sonar(hc_sr04());
  EXPECT_TRUE(sonar.within(kSecond, [] { return stop_level() == 0; })) << "free to go";
  echoes.width_us = 1000;  // 17 cm
  EXPECT_TRUE(sonar.within(250 * kMs, [] { return stop_level() == 1; })) << "five triggers";
  echoes.width_us = 8000;
  EXPECT_TRUE(sonar.within(kSecond, [] { return stop_level() == 0; }));
  sonar.stop();
  // The lines are still held by the sensor, which is still there.
  EXPECT_EQ(stop_level(), 1) << "when the thread has ended";
}

TEST(SonarOnGpioSim, WithoutAnAnswerItIsStuckAndLost) {
  Echoes echoes(g_sysfs, 5800);
  Running sonar(hc_sr04());
  ASSERT_TRUE(sonar.within(kSecond, [] { return stop_level() == 0; }));
  echoes.width_us = 0;
  EXPECT_TRUE(sonar.within(3 * kSecond, [&] { return sonar.holds(Fault::range_stuck); }));
  EXPECT_TRUE(sonar.within(kSecond, [&] { return sonar.holds(Fault::range_lost); }));
  EXPECT_EQ(stop_level(), 1);
  echoes.width_us = 5800;
  EXPECT_TRUE(sonar.within(kSecond, [&] {
    return !sonar.holds(Fault::range_stuck) && !sonar.holds(Fault::range_lost) && stop_level() == 0;
  }));
}

TEST(SonarOnGpioSim, APulseWidthSensorIsReadWithoutATrigger) {
  SonarConfig config = hc_sr04();
  config.kind = SonarKind::pulse_width;
  config.trigger_line = -1;
  config.max_m = 7;
  std::atomic<bool> done{false};
  std::thread sensor([&] {
    const Wire echo(g_sysfs, 1, "pull", O_WRONLY);
    while (!done) pulse(echo, 5800);  // a metre
  });
  Running sonar(config);
  const std::vector<RangeReading> readings = sonar.listen(kSecond);
  done = true;
  sensor.join();
  ASSERT_GE(readings.size(), 15u);
  EXPECT_TRUE(readings.back().valid);
  EXPECT_GE(readings.back().range_m, 1.0f);
  EXPECT_LE(readings.back().range_m, 1.07f);
}

TEST(SonarOnGpioSim, NoiseIsNoReadingAndEndsNothing) {
  Echoes echoes(g_sysfs, 5800);
  Running sonar(hc_sr04());
  ASSERT_TRUE(sonar.within(kSecond, [] { return stop_level() == 0; }));
  {
    const Wire echo(g_sysfs, 1, "pull", O_WRONLY);
    for (int i = 0; i < 2000; ++i) echo.pull(i % 2 == 0);  // far above what the kernel keeps
  }
  EXPECT_TRUE(
      sonar.within(2 * kSecond, [&] { return stop_level() == 0 && !sonar.holds(Fault::range_lost); }));
  sonar.listen(100 * kMs);
  const std::vector<RangeReading> readings = sonar.listen(kSecond);
  ASSERT_GE(readings.size(), 15u);
  size_t valid = 0;
  for (const RangeReading& reading : readings) {
    if (!reading.valid) continue;
    ++valid;
    EXPECT_NEAR(reading.range_m, 1.02, 0.05);
  }
  EXPECT_GE(4 * valid, 3 * readings.size()) << "the one that answers may miss a trigger";
}

TEST(SonarOnGpioSim, WhatIsWrongWithALineIsSaid) {
  EXPECT_EQ(sonar_line_problem(g_chip, 1), "");
  EXPECT_TRUE(test::contains(sonar_line_problem(g_chip, 9), "has the lines 0 to 2, not 9"));
  EXPECT_TRUE(test::contains(sonar_line_problem("/dev/gpiochip77", 1), "no such GPIO chip"));
  EXPECT_TRUE(test::contains(sonar_line_problem("/dev/null", 1), "GPIO chip; gpiodetect"));
  auto first = std::move(*make_gpio_sonar(hc_sr04()));
  ASSERT_EQ(first->open(), Status::ok) << first->error();
  EXPECT_TRUE(test::contains(sonar_line_problem(g_chip, 1), "in use by \"stillmap sonar\""));
  auto second = std::move(*make_gpio_sonar(hc_sr04()));
  EXPECT_EQ(second->open(), Status::unavailable);
  EXPECT_TRUE(test::contains(second->error(), "in use")) << second->error();
  EXPECT_EQ(first->open(), Status::ok) << "again";
  first.reset();
  EXPECT_EQ(second->open(), Status::ok) << second->error();
}

// The last: it takes the chip away.
TEST(SonarOnGpioSim, AChipThatIsPulledOutComesBack) {
  Running sonar(hc_sr04());
  {
    Echoes echoes(g_sysfs, 5800);
    ASSERT_TRUE(sonar.within(kSecond, [] { return stop_level() == 0; }));
  }
  ASSERT_EQ(std::system(("bash -c 'source " + g_gpio_sim + "; gpio_sim_remove sonar'").c_str()), 0);
  EXPECT_TRUE(sonar.within(2 * kSecond, [&] { return sonar.holds(Fault::range_lost); }));
  Notice notice;
  ASSERT_TRUE(sonar.queues.notices.pop_within(notice, std::chrono::milliseconds(2000)));
  std::printf("said: %s\n", notice.text);
  EXPECT_TRUE(test::contains(notice.text, "the GPIO lines are gone")) << notice.text;
  ASSERT_EQ(
      std::system(("bash -c 'source " + g_gpio_sim + "; gpio_sim_make sonar TRIGGER ECHO STOP'").c_str()), 0);
  Echoes echoes(g_sysfs, 5800);
  // It is looked for every ten seconds at least.
  EXPECT_TRUE(
      sonar.within(12 * kSecond, [&] { return !sonar.holds(Fault::range_lost) && stop_level() == 0; }));
}

int pulses_only(char** arguments) {
  const Wire echo(arguments[0], 1, "pull", O_WRONLY);
  const int64_t width_us = std::atol(arguments[1]);
  const int64_t until_ns = monotonic_ns() + std::atol(arguments[2]) * kSecond;
  while (monotonic_ns() < until_ns) pulse(echo, width_us);
  return 0;
}

}  // namespace
}  // namespace stillmap

int main(int count, char** arguments) {
  if (count == 5 && std::string(arguments[1]) == "--pulses") return stillmap::pulses_only(arguments + 2);
  testing::InitGoogleTest(&count, arguments);
  if (count != 4) {
    std::fprintf(stderr, "expected CHIP_DEVICE SYSFS GPIO_SIM_SH, or --pulses SYSFS WIDTH_US SECONDS\n");
    return 2;
  }
  stillmap::g_chip = arguments[1];
  stillmap::g_sysfs = arguments[2];
  stillmap::g_gpio_sim = arguments[3];
  return RUN_ALL_TESTS();
}
