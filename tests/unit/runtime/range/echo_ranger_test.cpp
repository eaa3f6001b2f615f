#include "runtime/range/echo_ranger.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace stillmap {
namespace {

constexpr int64_t kUs = 1'000, kMs = 1'000'000, kSecond = 1'000'000'000;
constexpr int64_t kStart = 100 * kSecond;

SonarConfig hc_sr04() {
  SonarConfig sonar;
  sonar.kind = SonarKind::hc_sr04;
  sonar.rate_hz = 20;
  return sonar;
}

SonarConfig pulse_width() {
  SonarConfig sonar;
  sonar.kind = SonarKind::pulse_width;
  sonar.max_m = 7;
  return sonar;
}

/// A ranger and the sensor on its line, in a time that only the test moves.
struct Bench {
  explicit Bench(const SonarConfig& config) : sonar(config), ranger(config, {kStart}) {}

  Stamp now() const { return {now_ns}; }
  void take(bool rising) {
    if (const auto reading = ranger.take({now(), rising})) readings.push_back(*reading);
  }
  /// The line is high for the time of the way to a thing and back.
  void pulse(float range_m) {
    const double m_per_ns = sonar.kind == SonarKind::hc_sr04
                                ? 0.5e-9 * static_cast<double>(speed_of_sound(sonar.temperature_c))
                                : 1e-3 / static_cast<double>(sonar.pulse_us_per_m);
    take(true);
    now_ns += static_cast<int64_t>(static_cast<double>(range_m) / m_per_ns);
    take(false);
  }
  /// Time goes on to `to_ns`; what is due on the way is done.
  void wait_until(int64_t to_ns) {
    while (now_ns < to_ns) {
      if (const auto silence = ranger.take_silence(now())) readings.push_back(*silence);
      if (ranger.wants_trigger(now())) {
        if (!answering) {
          ranger.triggered(now());
          ++triggers;
        } else {
          return;
        }
      }
      now_ns = std::min(to_ns, std::max(now_ns + 1, ranger.next_due(now()).ns));
    }
  }
  /// One cycle of an HC-SR04: trigger, and the answer.
  void cycle(float range_m) {
    answering = true;
    wait_until(now_ns + kSecond);
    answering = false;
    ASSERT_TRUE(ranger.wants_trigger(now()));
    ranger.triggered(now());
    ++triggers;
    now_ns += 450 * kUs;
    pulse(range_m);
  }
  const RangeReading& last() const { return readings.back(); }

  SonarConfig sonar;
  EchoRanger ranger;
  int64_t now_ns = kStart;
  std::vector<RangeReading> readings;
  int triggers = 0;
  bool answering = false;
};

TEST(SpeedOfSound, IsThatOfTheTables) {
  EXPECT_NEAR(speed_of_sound(0), 331.3, 0.1);
  EXPECT_NEAR(speed_of_sound(20), 343.2, 0.2);
  EXPECT_NEAR(speed_of_sound(-20), 318.9, 0.4);
  EXPECT_NEAR(speed_of_sound(40), 354.7, 0.4);
}

TEST(EchoRanger, TheWidthOfAPulseIsTheDistance) {
  Bench bench(hc_sr04());
  for (const float range_m : {0.5f, 0.51f, 0.52f}) bench.cycle(range_m);
  ASSERT_EQ(bench.readings.size(), 3u);
  EXPECT_TRUE(bench.last().valid);
  EXPECT_FALSE(bench.last().stop);
  EXPECT_NEAR(bench.last().range_m, 0.51, 1e-5) << "the median";
  // 5831 us at 20 degrees is a metre; the stamp is when the sound was there.
  Bench one(hc_sr04());
  one.ranger.triggered(one.now());
  one.ranger.take({{kStart + 1 * kMs}, true});
  const auto reading = one.ranger.take({{kStart + 1 * kMs + 5831 * kUs}, false});
  ASSERT_TRUE(reading);
  EXPECT_NEAR(reading->range_m, 1.0, 1e-3);
  EXPECT_EQ(reading->stamp.ns, kStart + 1 * kMs + 5831 * kUs / 2);
}

TEST(EchoRanger, ColdAirIsSlower) {
  SonarConfig cold = hc_sr04();
  cold.temperature_c = -20;
  EchoRanger ranger(cold, {kStart});
  ranger.triggered({kStart});
  ranger.take({{kStart + kMs}, true});
  EXPECT_NEAR(ranger.take({{kStart + kMs + 5831 * kUs}, false})->range_m, 318.9 / 343.2, 2e-3);
}

TEST(EchoRanger, APulseWidthSensorSpeaksForItself) {
  Bench bench(pulse_width());
  EXPECT_FALSE(bench.ranger.wants_trigger(bench.now()));
  for (int i = 0; i < 5; ++i) {
    bench.pulse(3.0f);  // 17.4 ms
    bench.wait_until(bench.now_ns + 80 * kMs);
  }
  ASSERT_EQ(bench.readings.size(), 5u);
  EXPECT_NEAR(bench.last().range_m, 3.0, 1e-4);
  EXPECT_TRUE(bench.last().valid);
  EXPECT_EQ(bench.triggers, 0);
}

TEST(EchoRanger, AsksAtTheRateAndNotBeforeTheAnswerIsOver) {
  Bench bench(hc_sr04());
  bench.wait_until(kStart + 2 * kSecond - 1);
  EXPECT_EQ(bench.triggers, 40);
  // 20 ms after the trigger the line rises and stays high for 200 ms, as that of some sensors without an
  // echo.
  Bench slow(hc_sr04());
  slow.wait_until(kStart + 20 * kMs);
  EXPECT_EQ(slow.triggers, 1);
  slow.take(true);
  slow.wait_until(kStart + 220 * kMs);
  EXPECT_EQ(slow.triggers, 1);
  slow.take(false);
  slow.wait_until(kStart + 222 * kMs);
  EXPECT_EQ(slow.triggers, 2);
  ASSERT_EQ(slow.readings.size(), 1u) << "no echo is said once, when its time is over";
  EXPECT_EQ(slow.last().range_m, 0.0f);
}

TEST(EchoRanger, AFallThatWasNotSeenDoesNotEndTheAsking) {
  Bench bench(hc_sr04());
  bench.wait_until(kStart + 10 * kMs);
  bench.take(true);
  bench.wait_until(kStart + kSecond);
  EXPECT_GE(bench.triggers, 14) << "after a quarter of a second it goes on";
}

TEST(EchoRanger, NoEchoIsAReadingToo) {
  Bench bench(hc_sr04());
  bench.wait_until(kStart + 51 * kMs);
  ASSERT_EQ(bench.readings.size(), 1u);
  EXPECT_EQ(bench.last().range_m, 0.0f);
  EXPECT_FALSE(bench.last().valid);
  EXPECT_EQ(bench.last().stamp.ns, kStart);
  // A pulse that says "nothing there" is no echo either, at once.
  bench.now_ns += kMs;
  bench.pulse(6.0f);  // max_m is 4
  ASSERT_EQ(bench.readings.size(), 2u);
  EXPECT_EQ(bench.last().range_m, 0.0f);
  EXPECT_FALSE(bench.last().valid);
  // And of a sensor that asks itself.
  Bench silent(pulse_width());
  silent.wait_until(kStart + 1001 * kMs);
  EXPECT_EQ(silent.readings.size(), 4u) << "every sonar.max_age_s";
}

TEST(EchoRanger, WithoutAnEchoItIsLostUntilThereIsOne) {
  Bench bench(hc_sr04());
  bench.cycle(1.0f);
  const int64_t heard_ns = bench.last().stamp.ns;
  for (int64_t at = bench.now_ns; at < heard_ns + 1900 * kMs; at = bench.now_ns) bench.cycle(6.0f);
  EXPECT_FALSE(bench.ranger.lost(bench.now()));
  EXPECT_FALSE(bench.ranger.stop_line(bench.now()));
  for (int i = 0; i < 4; ++i) bench.cycle(6.0f);
  EXPECT_TRUE(bench.ranger.lost(bench.now()));
  EXPECT_FALSE(bench.ranger.stuck(bench.now())) << "its line moves";
  EXPECT_TRUE(bench.ranger.stop_line(bench.now())) << "nobody knows what is there";
  bench.cycle(1.0f);
  EXPECT_FALSE(bench.ranger.lost(bench.now()));
  EXPECT_FALSE(bench.ranger.stop_line(bench.now()));
}

TEST(EchoRanger, ALineThatDoesNotMoveIsStuck) {
  Bench bench(hc_sr04());
  bench.cycle(1.0f);
  bench.wait_until(bench.now_ns + 1000 * kMs);
  EXPECT_FALSE(bench.ranger.stuck(bench.now()));
  bench.wait_until(bench.now_ns + 60 * kMs);
  EXPECT_TRUE(bench.ranger.stuck(bench.now()));
  EXPECT_TRUE(bench.ranger.stop_line(bench.now()));
  bench.cycle(1.0f);
  EXPECT_FALSE(bench.ranger.stuck(bench.now()));
  // At a low rate it is quiet for longer between two answers, and not stuck.
  SonarConfig rare = hc_sr04();
  rare.rate_hz = 0.5f;
  rare.lost_s = 10;
  Bench quiet(rare);
  quiet.ranger.triggered(quiet.now());
  quiet.now_ns += kMs;
  quiet.pulse(1.0f);
  EXPECT_FALSE(quiet.ranger.stuck({quiet.now_ns + 1900 * kMs}));
}

TEST(EchoRanger, ALineThatStaysHighIsStuckToo) {
  for (const SonarConfig& config : {hc_sr04(), pulse_width()}) {
    Bench bench(config);
    bench.wait_until(kStart + 20 * kMs);
    bench.take(true);
    bench.wait_until(kStart + 1400 * kMs);
    EXPECT_TRUE(bench.ranger.stuck(bench.now()));
  }
}

TEST(EchoRanger, GlitchesDoNotHideTheAnswer) {
  Bench bench(hc_sr04());
  bench.wait_until(kStart + 1);
  for (const int64_t width_ns : {1 * kUs, 30 * kUs, 100 * kUs}) {  // min_m is 2 cm: 116 us
    bench.now_ns += 50 * kUs;
    bench.take(true);
    bench.now_ns += width_ns;
    bench.take(false);
  }
  EXPECT_EQ(bench.ranger.spurious(), 3u);
  EXPECT_TRUE(bench.readings.empty());
  bench.pulse(1.5f);
  ASSERT_EQ(bench.readings.size(), 1u);
  EXPECT_NEAR(bench.last().range_m, 1.5, 1e-4);
}

TEST(EchoRanger, EdgesThatNobodyAskedForAreNoReadings) {
  Bench bench(hc_sr04());
  bench.take(false);  // it was high when it was opened
  bench.pulse(1.0f);  // before the first trigger
  EXPECT_TRUE(bench.readings.empty());
  EXPECT_EQ(bench.ranger.spurious(), 2u);
  bench.cycle(1.0f);
  EXPECT_EQ(bench.readings.size(), 1u);
  bench.pulse(1.0f);  // a second answer: a neighbour's echo
  EXPECT_EQ(bench.readings.size(), 1u);
}

TEST(EchoRanger, OneNearEchoSaysStopAndOnlyFartherOnesTakeItBack) {
  Bench bench(hc_sr04());
  for (int i = 0; i < 5; ++i) bench.cycle(2.0f);
  EXPECT_FALSE(bench.last().stop);
  bench.cycle(0.2f);  // stop_m is 0.25; it jumps: not yet believed
  EXPECT_FALSE(bench.last().valid);
  EXPECT_TRUE(bench.last().stop) << "at once";
  EXPECT_TRUE(bench.ranger.stop_line(bench.now()));
  bench.cycle(6.0f);
  EXPECT_TRUE(bench.last().stop) << "what is too near gives no echo";
  bench.cycle(0.2f);
  bench.cycle(0.2f);
  EXPECT_TRUE(bench.last().valid);
  EXPECT_NEAR(bench.last().range_m, 0.2, 1e-4);
  bench.cycle(0.5f);
  EXPECT_TRUE(bench.last().stop) << "the median still says near";
  bench.cycle(0.5f);
  EXPECT_FALSE(bench.last().stop);
  EXPECT_FALSE(bench.ranger.stop_line(bench.now()));
}

TEST(EchoRanger, TheStopLineIsHighUntilSomethingIsKnown) {
  Bench bench(hc_sr04());
  EXPECT_TRUE(bench.ranger.stop_line(bench.now()));
  bench.cycle(6.0f);
  EXPECT_TRUE(bench.ranger.stop_line(bench.now())) << "no echo is no proof";
  bench.cycle(1.0f);
  EXPECT_FALSE(bench.ranger.stop_line(bench.now()));
}

TEST(EchoRanger, OpenedAgainItIsLostUntilItHears) {
  Bench bench(hc_sr04());
  bench.cycle(1.0f);
  bench.now_ns += 300 * kMs;
  bench.ranger.reopened(bench.now());
  EXPECT_TRUE(bench.ranger.lost(bench.now()));
  EXPECT_TRUE(bench.ranger.stop_line(bench.now()));
  bench.cycle(1.0f);
  EXPECT_FALSE(bench.ranger.lost(bench.now()));
  EXPECT_FALSE(bench.ranger.stop_line(bench.now()));
}

// Whatever the line does: readings stay in range, valid ones are rare among noise, and waits move on.
TEST(EchoRanger, NoiseDoesNoHarm) {
  std::mt19937 random(7);
  for (const SonarConfig& config : {hc_sr04(), pulse_width()}) {
    EchoRanger ranger(config, {kStart});
    int64_t now_ns = kStart;
    for (int i = 0; i < 50000; ++i) {
      now_ns += std::uniform_int_distribution<int64_t>(0, 20 * kMs)(random);
      const auto silence = ranger.take_silence({now_ns});
      if (ranger.wants_trigger({now_ns})) ranger.triggered({now_ns});
      EXPECT_GE(ranger.next_due({now_ns}).ns, now_ns);
      const auto reading = ranger.take({{now_ns}, random() % 2 == 0});
      for (const auto& r : {silence, reading}) {
        if (!r || r->range_m == 0) continue;
        ASSERT_GE(r->range_m, config.min_m);
        ASSERT_LE(r->range_m, config.max_m);
        ASSERT_TRUE(r->stop || r->range_m >= config.stop_m);
      }
    }
  }
}

}  // namespace
}  // namespace stillmap
