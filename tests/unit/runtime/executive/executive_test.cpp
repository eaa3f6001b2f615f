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
  uint32_t encode(const RangeMessage&, View<uint8_t>) const override { return 0; }
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
  mutable StatusMessage last;
  bool down = false;
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
    if (trouble) flaky.emplace(paced, *trouble, 15, reopen_failures);
    FrameSource& frames = flaky ? static_cast<FrameSource&>(*flaky) : live ? paced : *source;
    ExecutiveParts parts{frames, engine, pipeline, notebook, state, clock};
    parts.codec = &ear;
    parts.bus = &ear;
    parts.commands = &orders;
    parts.stop_requested = [this] { return stop.load(); };
    parts.on_status = [this](const StatusMessage& status) { modes.push_back(status.mode); };
    Executive executive(parts, config, {{}, max_frames, live, keep_images});
    const RunEnd end = executive.run();
    if (flaky) reopened_ns = flaky->reopened_ns;
    return end;
  }
  bool was_in(Mode mode) const { return std::find(modes.begin(), modes.end(), mode) != modes.end(); }

  Config config;
  std::unique_ptr<FrameSource> source;
  Notebook notebook;
  Ear ear;
  Orders orders;
  RunState state;
  UtcClock clock;
  std::vector<Mode> modes;
  std::atomic<bool> stop{false};
  bool keep_images = false, slow_camera = false;
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
  EXPECT_EQ(end.state, TrackingState::good);
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
  EXPECT_GT(notebook.items.size(), 30u);
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
  EXPECT_GT(notebook.items.size(), 15u);
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
  delays.track_ms = 0.2 * kSlowPeriod_ms;
  delays.integrate_ms = 1.3 * kSlowPeriod_ms;
  run("crowd,size=80x60,seconds=3", true);
  EXPECT_TRUE(notebook.heard("work_shed: every second frame is not mapped"));
  EXPECT_EQ(ear.last.shed, Shed::every_second_integration);
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
  EXPECT_NEAR(state.frames_dropped, 20, 8);  // of 60: a pose every one and a half periods, at the most
  EXPECT_EQ(state.frames_dropped + notebook.items.size(), 60u);
  EXPECT_GT(state.faults.entry(Fault::frame_dropped).count, 0u);
  // It never works through old frames: a pose is as old as the frame took, and what of a period it waited.
  EXPECT_LT(ear.age_percentile_ms(0.99), 3 * kSlowPeriod_ms);
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

}  // namespace
}  // namespace stillmap
