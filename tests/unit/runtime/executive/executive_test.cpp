#include "runtime/executive/executive.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <thread>
#include <vector>

#include "config/engine_params.hpp"
#include "drivers/synthetic/synthetic_source.hpp"
#include "runtime/core/heap_guard.hpp"
#include "runtime/executive/paced_source.hpp"
#include "tests/support/delayed_engine.hpp"

namespace stillmap {
namespace {

constexpr double kPeriod_ms = 1e3 / 30;

/// A camera that takes three times as long: what this test itself costs a frame must not matter.
class SlowCamera final : public FrameSource {
 public:
  static constexpr int64_t kTimes = 3;
  explicit SlowCamera(FrameSource& source) : source_(source) {}

  const SourceInfo& info() const override { return source_.info(); }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override {
    const Status status = source_.next(frame, timeout_ms);
    frame.depth_stamp.ns *= kTimes;
    return status;
  }
  void skip(uint32_t count) override { source_.skip(count); }
  const std::string& error() const override { return source_.error(); }

 private:
  FrameSource& source_;
};
constexpr double kSlowPeriod_ms = kPeriod_ms * SlowCamera::kTimes;

/// Its frames have no depth until they are finished. One frame at a time.
class UnfinishedCamera final : public FrameSource {
 public:
  explicit UnfinishedCamera(FrameSource& source) : source_(source) {}

  const SourceInfo& info() const override { return source_.info(); }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override { return source_.next(frame, timeout_ms); }
  Status next_unfinished(RgbdFrame& frame, int32_t timeout_ms) override {
    const Status status = next(frame, timeout_ms);
    uint16_t* const depth = frame.depth_raw.data;
    depth_.assign(depth, depth + frame.depth_raw.rows * frame.depth_raw.cols);
    std::fill_n(depth, depth_.size(), uint16_t{0});
    return status;
  }
  void finish(RgbdFrame& frame) override { std::copy(depth_.begin(), depth_.end(), frame.depth_raw.data); }
  void skip(uint32_t count) override { source_.skip(count); }
  const std::string& error() const override { return source_.error(); }

 private:
  FrameSource& source_;
  std::vector<uint16_t> depth_;
};

/// A camera that stops at one of its frames, by going away or by saying nothing, until it is opened again.
class FlakyCamera final : public FrameSource {
 public:
  enum class Trouble { gone, silent };
  FlakyCamera(FrameSource& source, Trouble trouble, uint32_t at_frame, uint32_t failures)
      : source_(source), trouble_(trouble), left_(at_frame), failures_(failures) {}

  const SourceInfo& info() const override { return source_.info(); }
  bool live() const override { return true; }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override {
    if (!well_ && trouble_ == Trouble::gone) return Status::unavailable;
    if (!well_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(timeout_ms));
      return Status::timeout;
    }
    const Status status = source_.next(frame, timeout_ms);
    if (status == Status::ok && --left_ == 0) well_ = false;
    return status;
  }
  Status reopen() override {
    reopened_ns.push_back(monotonic_ns());
    if (reopened_ns.size() <= failures_) return Status::unavailable;
    well_ = true;
    return Status::ok;
  }
  void skip(uint32_t count) override { source_.skip(count); }
  const std::string& error() const override { return error_; }

  std::vector<int64_t> reopened_ns;

 private:
  FrameSource& source_;
  const Trouble trouble_;
  uint32_t left_;
  const uint32_t failures_;
  bool well_ = true;
  std::string error_ = "the cable was pulled";
};

/// Keeps what it is told.
class Notebook final : public RunRecorder {
 public:
  void add(const RunItem& item, const RgbdFrame* frame, ImageView<const uint8_t>) override {
    if (item.has_frame) items.push_back(item);
    with_images += frame != nullptr;
  }
  void add(const RangeReading& reading) override { ranges.push_back(reading); }
  void add(const Notice& notice) override {
    notices.emplace_back(std::string(notice.name) + ": " + notice.text);
  }
  void idle() override {
    if (slow.count() > 0) std::this_thread::sleep_for(slow);
  }

  bool heard(const std::string& text) const {
    return std::any_of(notices.begin(), notices.end(),
                       [&](const std::string& n) { return n.find(text) != std::string::npos; });
  }

  std::vector<RunItem> items;
  std::vector<RangeReading> ranges;
  std::vector<std::string> notices;
  int with_images = 0;
  std::chrono::milliseconds slow{0};
};

/// Keeps when each message was sent.
class Ear final : public MessageBus, public MessageCodec {
 public:
  Status publish(const char*, View<const uint8_t>) override {
    return down ? Status::unavailable : Status::ok;
  }
  uint32_t encode(const PoseMessage& message, View<uint8_t>) const override {
    if (count < kMost) poses[count++] = {message.utime.us, wall_ns() / 1000};
    return 1;
  }
  uint32_t encode(const StatusMessage& message, View<uint8_t>) const override {
    last = message;
    return 1;
  }
  uint32_t encode(const RangeMessage& message, View<uint8_t>) const override {
    if (range_count < kMost) ranges[range_count++] = {message, monotonic_ns()};
    return 1;
  }
  uint32_t encode(const CommandMessage&, View<uint8_t>) const override { return 0; }
  uint32_t encode(const FrameMessage&, View<uint8_t>) const override { return 0; }
  uint32_t encode(const DecisionMessage&, View<uint8_t>) const override { return 0; }
  uint32_t encode(const SessionMessage&, View<uint8_t>) const override { return 0; }
  uint32_t encode(const EventMessage&, View<uint8_t>) const override { return 0; }
  Status decode(View<const uint8_t>, PoseMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, StatusMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, RangeMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, CommandMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, FrameMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, DecisionMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, SessionMessage&) const override { return Status::bad_data; }
  Status decode(View<const uint8_t>, EventMessage&) const override { return Status::bad_data; }

  double age_percentile_ms(double share, size_t from = 0) const {
    std::vector<double> ages;
    for (size_t i = from; i < count; ++i)
      ages.push_back(static_cast<double>(poses[i].sent_us - poses[i].captured_us) * 1e-3);
    std::sort(ages.begin(), ages.end());
    return ages[static_cast<size_t>(share * static_cast<double>(ages.size() - 1))];
  }

  struct Sent {
    int64_t captured_us = 0, sent_us = 0;
  };
  static constexpr size_t kMost = 1000;
  mutable std::array<Sent, kMost> poses{};
  mutable size_t count = 0;
  struct SentRange {
    RangeMessage message;
    int64_t sent_ns = 0;
  };
  mutable std::array<SentRange, kMost> ranges{};
  mutable size_t range_count = 0;
  mutable StatusMessage last;
  bool down = false;
};

/// A sonar whose line the test drives: an echo of `range_m` to every trigger.
class FakeSonar final : public RangeSensor {
 public:
  Status open() override {
    ++opened;
    if (monotonic_ns() < gone_until_ns) return Status::unavailable;
    pending_ = 0;
    return set_stop(true);
  }
  Status trigger(Stamp& at) override {
    if (monotonic_ns() < gone_until_ns) return Status::unavailable;
    at.ns = monotonic_ns();
    ++triggers;
    const float range_m = echoes_m[std::min(triggers - 1, static_cast<uint32_t>(echoes_m.size()) - 1)];
    if (range_m == kGone) {
      gone_until_ns = at.ns + gone_ns;
      return Status::unavailable;
    }
    if (range_m == kNoAnswer) return Status::ok;
    const auto pulse_ns = static_cast<int64_t>(2e9f * range_m / speed_of_sound(20));
    edges_[0] = {{at.ns + 300'000}, true};
    edges_[1] = {{at.ns + 300'000 + pulse_ns}, false};
    pending_ = 2;
    return Status::ok;
  }
  Status next_edge(EchoEdge& edge, int32_t timeout_ms) override {
    if (pending_ == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(timeout_ms));
      return Status::timeout;
    }
    edge = edges_[2 - pending_--];
    while (monotonic_ns() < edge.stamp.ns) std::this_thread::sleep_for(std::chrono::microseconds(100));
    return Status::ok;
  }
  Status set_stop(bool high) override {
    stop_line = high;
    ++(high ? to_stop : to_go);
    if (high) stopped_ns = monotonic_ns();
    return Status::ok;
  }
  const std::string& error() const override { return error_; }

  static constexpr float kNoAnswer = 0, kGone = -1;
  std::vector<float> echoes_m = {1.0f};  ///< to one trigger after the other; the last goes on
  int64_t gone_ns = 0, gone_until_ns = 0;
  uint32_t triggers = 0, opened = 0, to_stop = 0, to_go = 0;
  bool stop_line = false;
  int64_t stopped_ns = 0;

 private:
  EchoEdge edges_[2];
  uint32_t pending_ = 0;
  const std::string error_ = "the chip was pulled out";
};

class Orders final : public CommandPort {
 public:
  Status next(CommandMessage& command) override {
    if (waiting.empty()) return Status::timeout;
    command = waiting.back();
    waiting.pop_back();
    return Status::ok;
  }
  uint32_t refused() const override { return foreign; }
  std::vector<CommandMessage> waiting;
  uint32_t foreign = 0;
};

class Executives : public testing::Test {
 protected:
  void SetUp() override {
    config.map.pool_blocks = 20000;
    config.map.voxel_m = 0.04f;
    config.map.truncation_m = 0.16f;
    config.runtime.threads = 1;
  }
  RunEnd run(const std::string& scene, bool live, uint32_t max_frames = 0) {
    auto opened = open_synthetic(scene, 1);
    EXPECT_TRUE(opened) << opened.error();
    source = std::move(*opened);
    const SourceInfo& info = source->info();
    const auto real = make_cpu_engine(engine_params(config, info.camera, info.depth_units_per_m));
    test::DelayedEngine engine(*real, delays);
    Pipeline pipeline(engine, config);
    SlowCamera slow(*source);
    PacedSource paced(slow_camera ? static_cast<FrameSource&>(slow) : *source);
    std::optional<FlakyCamera> flaky;
    if (trouble) flaky.emplace(paced, *trouble, kFramesBefore, reopen_failures);
    UnfinishedCamera unfinished(*source);
    FrameSource& frames = flaky          ? static_cast<FrameSource&>(*flaky)
                          : live         ? paced
                          : in_two_parts ? unfinished
                                         : *source;
    ExecutiveParts parts{frames, engine, pipeline, notebook, state, clock};
    parts.codec = &ear;
    parts.bus = &ear;
    parts.commands = &orders;
    parts.sonar = sonar;
    parts.stop_requested = [this] { return stop.load(); };
    parts.on_status = [this](const StatusMessage& status) { modes.push_back(status.mode); };
    Executive executive(parts, config, {{}, max_frames, live, keep_images});
    const RunEnd end = executive.run();
    if (flaky) reopened_ns = flaky->reopened_ns;
    return end;
  }
  bool was_in(Mode mode) const { return std::find(modes.begin(), modes.end(), mode) != modes.end(); }

  static constexpr uint32_t kFramesBefore = 15;  ///< of a flaky camera, the trouble
  Config config;
  std::unique_ptr<FrameSource> source;
  Notebook notebook;
  Ear ear;
  Orders orders;
  RunState state;
  UtcClock clock;
  std::vector<Mode> modes;
  RangeSensor* sonar = nullptr;
  std::atomic<bool> stop{false};
  bool keep_images = false, slow_camera = false, in_two_parts = false;
  test::EngineDelays delays;
  std::optional<FlakyCamera::Trouble> trouble;
  uint32_t reopen_failures = 0;
  std::vector<int64_t> reopened_ns;
};

TEST_F(Executives, ARecordingIsWorkedThroughWithoutLosingAFrame) {
  notebook.slow = std::chrono::milliseconds(2);
  const RunEnd end = run("crowd,size=80x60,seconds=2", false);
  EXPECT_EQ(end.error, "");
  ASSERT_EQ(notebook.items.size(), 60u);
  for (uint32_t i = 0; i < 60; ++i) EXPECT_EQ(notebook.items[i].result.sequence, i);
  EXPECT_EQ(notebook.with_images, 60);
  EXPECT_EQ(state.frames_dropped, 0u);
  EXPECT_EQ(ear.count, 60u);  // a pose each
  EXPECT_EQ(ear.last.frame, 59u);
}

TEST_F(Executives, AFrameIsFinishedBeforeItIsWorkedOn) {
  in_two_parts = true;
  run("crowd,size=80x60,seconds=2", false, 20);
  ASSERT_EQ(notebook.items.size(), 20u);
  for (const RunItem& item : notebook.items) EXPECT_EQ(item.result.status, Status::ok);
  EXPECT_EQ(notebook.items.back().result.state, TrackingState::good);
}

TEST_F(Executives, ItEndsAtTheLimitOfFrames) {
  run("crowd,size=80x60,seconds=2", false, 7);
  EXPECT_EQ(notebook.items.size(), 7u);
}

TEST_F(Executives, AStopEndsIt) {
  std::thread signal([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    stop = true;
  });
  const int64_t start_ns = monotonic_ns();
  run("crowd,size=80x60,seconds=60", true);
  signal.join();
  EXPECT_LT(static_cast<double>(monotonic_ns() - start_ns) * 1e-9, 10.0);
  EXPECT_TRUE(notebook.heard("mode: safe_stop"));
}

TEST_F(Executives, ACameraThatIsGoneIsOpenedAgainAndTheMapStays) {
  config.source.reopen_s = 0.1f;
  config.source.reopen_max_s = 0.2f;
  trouble = FlakyCamera::Trouble::gone;
  reopen_failures = 3;
  const RunEnd end = run("crowd-static,size=80x60,seconds=3", true);
  EXPECT_EQ(end.error, "");
  // With a sanitizer too few frames are left to find the camera in.
  EXPECT_TRUE(end.state == TrackingState::good || !heap_guard::counts());
  ASSERT_EQ(reopened_ns.size(), 4u);
  // Twice the wait after each failure, up to the longest.
  EXPECT_GE(reopened_ns[1] - reopened_ns[0], 100'000'000);
  EXPECT_GE(reopened_ns[2] - reopened_ns[1], 200'000'000);
  EXPECT_GE(reopened_ns[3] - reopened_ns[2], 200'000'000);
  EXPECT_EQ(state.faults.entry(Fault::camera_gone).count, 1u);
  EXPECT_EQ(state.faults.active() >> static_cast<uint32_t>(Fault::camera_gone) & 1, 0u);
  EXPECT_TRUE(notebook.heard("camera_gone: the cable was pulled"));
  EXPECT_TRUE(notebook.heard("camera_gone: back after"));
  EXPECT_TRUE(was_in(Mode::lost));
  EXPECT_EQ(state.map_id, 0u);  // the map it had
  EXPECT_GT(notebook.items.back().result.sequence, kFramesBefore);
}

TEST_F(Executives, ACameraThatSaysNothingIsStalledThenOpenedAgain) {
  config.source.stall_s = 0.2f;
  config.source.gone_s = 0.5f;
  trouble = FlakyCamera::Trouble::silent;
  const RunEnd end = run("crowd-static,size=80x60,seconds=2", true);
  EXPECT_EQ(end.error, "");
  EXPECT_EQ(reopened_ns.size(), 1u);
  EXPECT_GE(state.faults.entry(Fault::camera_stalled).count, 1u);
  EXPECT_EQ(state.faults.entry(Fault::camera_gone).count, 1u);
  EXPECT_GT(notebook.items.back().result.sequence, kFramesBefore);
}

TEST_F(Executives, AStopEndsTheWaitForACamera) {
  config.source.reopen_s = 1000;
  config.source.reopen_max_s = 1000;
  trouble = FlakyCamera::Trouble::gone;
  reopen_failures = 1000;
  std::thread signal([this] {
    while ((state.faults.active() >> static_cast<uint32_t>(Fault::camera_gone) & 1) == 0)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    stop = true;
  });
  const RunEnd end = run("crowd-static,size=80x60,seconds=60", true);
  signal.join();
  EXPECT_EQ(end.error, "");
  EXPECT_EQ(reopened_ns.size(), 1u);
}

TEST_F(Executives, ForeignMessagesAreAFault) {
  orders.foreign = 3;
  run("crowd,size=80x60,seconds=1", false);
  EXPECT_EQ(state.faults.entry(Fault::foreign_message).count, 3u);
}

TEST_F(Executives, OdometryThatIsNotThereIsAFault) {
  config.track.prior = MotionPrior::odometry;
  run("crowd,size=80x60,seconds=1", false);
  EXPECT_EQ(state.faults.entry(Fault::odometry_stale).count, 1u);
}

TEST_F(Executives, WithoutANetworkItGoesOnAndSaysSo) {
  ear.down = true;
  run("crowd,size=80x60,seconds=1", false);
  EXPECT_EQ(notebook.items.size(), 30u);
  EXPECT_GT(state.faults.entry(Fault::bus_unavailable).count, 0u);
  EXPECT_TRUE(notebook.heard("bus_unavailable"));
}

// A frame takes one and a half periods as long as all of it is done: mapping goes first.
TEST_F(Executives, WhatIsTooMuchIsShedAndPosesGoOnAtTheCamerasRate) {
  if (!heap_guard::counts()) GTEST_SKIP() << "a sanitizer takes longer than the camera";
  slow_camera = true;
  delays.track_ms = 0.05 * kSlowPeriod_ms;
  delays.integrate_ms = 1.45 * kSlowPeriod_ms;
  run("crowd,size=80x60,seconds=3", true);
  EXPECT_TRUE(notebook.heard("work_shed: every second frame is not mapped"));
  EXPECT_NE(ear.last.shed, Shed::nothing)
      << "the finest level may go as well where others take the processor";
  EXPECT_GT(state.deadline_misses, 20u);
  // From then on no frame is left out, every second one is mapped, and poses are fresh.
  const auto shed = std::find_if(notebook.items.begin(), notebook.items.end(),
                                 [](const RunItem& item) { return item.decision.shed != Shed::nothing; });
  ASSERT_GE(notebook.items.end() - shed, 30);
  const auto since = static_cast<size_t>(notebook.items.end() - shed) - 2;  // it has to catch up first
  EXPECT_GE(since, 0.8 * (notebook.items.back().result.sequence - (shed + 2)->result.sequence));
  const auto mapped = std::count_if(shed + 2, notebook.items.end(),
                                    [](const RunItem& item) { return item.result.integrated; });
  EXPECT_NEAR(static_cast<double>(mapped), 0.5 * static_cast<double>(since), 3);
  EXPECT_LE(ear.age_percentile_ms(0.9, ear.count - since), 2 * kSlowPeriod_ms);
}

TEST_F(Executives, WhereTrackingAloneIsTooMuchTheNewestFrameWins) {
  if (!heap_guard::counts()) GTEST_SKIP() << "a sanitizer takes longer than the camera";
  slow_camera = true;
  delays.track_ms = 1.5 * kSlowPeriod_ms;
  run("crowd,size=80x60,seconds=2", true);
  EXPECT_GE(state.frames_dropped, 12u);  // of 60: a pose every one and a half periods, at the most
  EXPECT_LE(state.frames_dropped, 35u);
  EXPECT_EQ(state.frames_dropped + notebook.items.size(), 60u);
  EXPECT_GT(state.faults.entry(Fault::frame_dropped).count, 0u);
  // It never works through old frames: a pose is as old as the frame took, and what of a period it waited.
  // Were there a queue, the last poses would be twenty periods old.
  EXPECT_LT(ear.age_percentile_ms(0.5), 3 * kSlowPeriod_ms);
  EXPECT_LT(ear.age_percentile_ms(0.9), 4 * kSlowPeriod_ms);
}

TEST_F(Executives, ARecorderThatIsBehindCostsImagesNotPoses) {
  if (!heap_guard::counts()) GTEST_SKIP() << "a sanitizer takes longer than the camera";
  keep_images = true;
  notebook.slow = std::chrono::milliseconds(100);
  run("crowd,size=80x60,seconds=2", true);
  EXPECT_EQ(notebook.items.size() + state.frames_dropped, 60u);  // every frame that was worked on is there
  EXPECT_LT(notebook.with_images, 40);
  EXPECT_GT(state.results_dropped, 10u);
  EXPECT_GT(ear.count, 30u);
}

TEST_F(Executives, AResetBeginsANewMapInANewEpoch) {
  CommandMessage reset;
  reset.id = 5;
  reset.command = Command::reset;
  orders.waiting = {reset};
  run("crowd,size=80x60,seconds=2", true);
  EXPECT_EQ(ear.last.pose_epoch, 1u);
  EXPECT_EQ(ear.last.command_id, 5u);
  EXPECT_EQ(ear.last.command_result, CommandResult::done);
}

TEST_F(Executives, CommandsThatCannotBeObeyedAreRefused) {
  CommandMessage save;
  save.id = 6;
  save.command = Command::save_map;  // there is no folder to save into
  orders.waiting = {save};
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_EQ(ear.last.command_id, 6u);
  EXPECT_EQ(ear.last.command_result, CommandResult::refused);
}

class WithASonar : public Executives {
 protected:
  void SetUp() override {
    Executives::SetUp();
    config.sonar.kind = SonarKind::hc_sr04;
    config.sonar.rate_hz = 20;
    config.sonar.lost_s = 0.3f;
    config.sonar.stuck_s = 0.3f;
    sonar = &fake;
  }
  bool held(Fault fault) const { return state.faults.entry(fault).count > 0; }
  bool holds(Fault fault) const { return (state.faults.active() >> static_cast<uint32_t>(fault) & 1) != 0; }

  FakeSonar fake;
};

TEST_F(WithASonar, AReadingReachesTheFrameTheNetworkAndTheLog) {
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_GE(ear.range_count, 10u);
  EXPECT_GE(notebook.ranges.size(), ear.range_count - 1);
  EXPECT_NEAR(ear.ranges[5].message.range_m, 1.0, 1e-3);
  EXPECT_TRUE(ear.ranges[5].message.valid);
  EXPECT_FALSE(ear.ranges[5].message.stop);
  EXPECT_EQ(ear.ranges[5].message.max_range_m, config.sonar.max_m);
  EXPECT_NEAR(static_cast<double>(ear.ranges[5].message.utime.us),
              static_cast<double>(clock.to_utc_us(notebook.ranges[5].stamp.ns)), 1000);
  // What a frame was told is in its decision: none before the first reading, then that of its time.
  const auto told = std::count_if(notebook.items.begin(), notebook.items.end(), [](const RunItem& item) {
    return std::abs(item.decision.sonar_m - 1.0f) < 1e-3f;
  });
  EXPECT_GE(static_cast<size_t>(told) + 10, notebook.items.size());
  EXPECT_FALSE(held(Fault::range_lost));
  EXPECT_FALSE(held(Fault::range_stuck));
  EXPECT_TRUE(fake.stop_line) << "where the program ends, the line says stop";
  EXPECT_EQ(fake.to_go, 1u);
}

TEST_F(WithASonar, WithoutASonarAFrameIsToldNothing) {
  sonar = nullptr;
  run("crowd,size=80x60,seconds=1", true);
  for (const RunItem& item : notebook.items) EXPECT_EQ(item.decision.sonar_m, 0.0f);
  EXPECT_EQ(ear.range_count, 0u);
}

// Far, then suddenly near: the line and the message do not wait for the median, nor for a frame.
TEST_F(WithASonar, WhatIsTooNearStopsAtOnce) {
  fake.echoes_m = std::vector<float>(8, 2.0f);
  fake.echoes_m.push_back(0.2f);
  run("crowd,size=80x60,seconds=1", true);
  const auto* first = std::find_if(ear.ranges.begin(), ear.ranges.begin() + ear.range_count,
                                   [](const Ear::SentRange& sent) { return sent.message.stop; });
  ASSERT_EQ(first - ear.ranges.begin(), 8);
  EXPECT_EQ(fake.to_go, 1u);
  EXPECT_EQ(fake.to_stop, 2u) << "when it was opened, and then; it is high when the program ends";
  const int64_t sound_ns = clock.to_monotonic_ns(first->message.utime.us);
  if (!heap_guard::counts()) return;  // a sanitizer takes its time
  EXPECT_LT(static_cast<double>(fake.stopped_ns - sound_ns) * 1e-6, 50.0);
  EXPECT_LT(static_cast<double>(first->sent_ns - sound_ns) * 1e-6, 50.0);
}

TEST_F(WithASonar, NoEchoIsLostAndAnEchoBringsItBack) {
  fake.echoes_m = std::vector<float>(4, 1.0f);
  fake.echoes_m.insert(fake.echoes_m.end(), 9, 6.0f);  // beyond sonar.max_m
  fake.echoes_m.push_back(1.0f);
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_EQ(state.faults.entry(Fault::range_lost).count, 1u);
  EXPECT_FALSE(holds(Fault::range_lost));
  EXPECT_FALSE(held(Fault::range_stuck));
  EXPECT_TRUE(notebook.heard("range_lost"));
  EXPECT_EQ(std::count(modes.begin(), modes.end(), Mode::degraded) > 0, true);
  EXPECT_EQ(fake.to_go, 2u) << "while it is lost the line says stop";
}

TEST_F(WithASonar, ALineThatDoesNotMoveIsStuck) {
  fake.echoes_m = {1.0f, 1.0f, 1.0f, FakeSonar::kNoAnswer};
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_TRUE(holds(Fault::range_stuck));
  EXPECT_TRUE(holds(Fault::range_lost));
  EXPECT_TRUE(fake.stop_line);
  EXPECT_EQ(notebook.items.size() + state.frames_dropped, 30u) << "frames go on";
}

TEST_F(WithASonar, AChipThatIsPulledOutComesBack) {
  fake.echoes_m = {1.0f, 1.0f, FakeSonar::kGone, 1.0f};
  fake.gone_ns = 300'000'000;
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_EQ(fake.opened, 3u) << "at boot, at once, and half a second later";
  EXPECT_EQ(state.faults.entry(Fault::range_lost).count, 1u);
  EXPECT_FALSE(holds(Fault::range_lost));
  EXPECT_EQ(std::count_if(notebook.notices.begin(), notebook.notices.end(),
                          [](const std::string& n) { return n == "range_lost: the chip was pulled out"; }),
            1);
  EXPECT_GT(fake.triggers, 5u);
}

TEST_F(WithASonar, OneThatIsNeverThereEndsNothing) {
  fake.gone_until_ns = std::numeric_limits<int64_t>::max();
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_TRUE(holds(Fault::range_lost));
  EXPECT_LE(fake.opened, 3u) << "it is looked for less and less often";
  EXPECT_EQ(notebook.items.size() + state.frames_dropped, 30u);
}

// The real-time, publish and sonar threads leave the heap alone.
TEST_F(WithASonar, NothingOfItAllocates) {
  if (!heap_guard::counts()) GTEST_SKIP() << "the sanitizer's heap is not counted";
  fake.echoes_m = {1.0f, 0.2f, 6.0f, 1.0f, FakeSonar::kNoAnswer, 1.0f};
  const uint64_t before = heap_guard::allocations();
  run("crowd,size=80x60,seconds=1", true);
  EXPECT_EQ(heap_guard::allocations(), before);
}

}  // namespace
}  // namespace stillmap
