#include "drivers/recording/log_source.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <random>

#include "tests/support/contains.hpp"
#include "tests/support/logged_run.hpp"
#include "tests/support/sample_messages.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using test::contains;
using test::FrameMemory;
using test::LoggedRun;

std::unique_ptr<LogSource> open(const std::string& path, const DatasetOptions& options = {}) {
  auto source = LogSource::open(path, options);
  EXPECT_TRUE(source) << source.error();
  return source ? std::move(*source) : nullptr;
}

void expect_frame(uint32_t n, const RgbdFrame& frame) {
  const FrameMemory expected = test::logged_frame(n);
  EXPECT_EQ(frame.sequence, n);
  EXPECT_EQ(frame.depth_stamp, expected.frame.depth_stamp);
  EXPECT_EQ(frame.colour_stamp, expected.frame.colour_stamp);
  for (int32_t r = 0; r < 24; ++r) {
    ASSERT_EQ(std::memcmp(frame.depth_raw.row(r), expected.frame.depth_raw.row(r), 32 * sizeof(uint16_t)), 0);
    ASSERT_EQ(std::memcmp(frame.colour.row(r), expected.frame.colour.row(r), 32 * sizeof(Rgb8)), 0);
  }
}

struct Played {
  std::vector<uint32_t> frames;
  std::vector<std::string> bad;
};

/// Reads to the end; every good frame has to be what was recorded.
Played play(LogSource& source) {
  Played played;
  FrameMemory memory(source.info());
  for (int guard = 0; guard < 10000; ++guard) {
    const Status status = source.next(memory.frame, 0);
    if (status == Status::end) return played;
    if (status == Status::bad_data) played.bad.push_back(source.error());
    if (status == Status::unavailable) break;
    if (status != Status::ok) continue;
    expect_frame(memory.frame.sequence, memory.frame);
    played.frames.push_back(memory.frame.sequence);
  }
  ADD_FAILURE() << "the source does not end: " << source.error();
  return played;
}

using Frames = std::vector<uint32_t>;

TEST(LogSource, GivesTheUsedFramesAndWhatTheSessionSays) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    for (uint32_t n = 0; n < 6; ++n) {
      ASSERT_EQ(run.recorder().write(samples::pose()), Status::ok);
      ASSERT_EQ(run.add(test::decision_about(n, n != 2 && n != 3)), Status::ok);
    }
  }
  auto source = open(dir.path("log-000001.lcm"));
  const SourceInfo& info = source->info();
  EXPECT_EQ(info.name, "log:" + dir.path("log-000001.lcm"));
  EXPECT_EQ(info.camera.k.width, 32);
  EXPECT_EQ(info.camera.k.height, 24);
  EXPECT_EQ(info.camera.k.fx, 30.25f);
  EXPECT_EQ(info.camera.k.cy, 11.5f);
  EXPECT_EQ(info.camera.distortion.p1, 0.001f);
  EXPECT_EQ(info.depth_units_per_m, 5000.0f);
  EXPECT_EQ(source->session().source, "test");
  EXPECT_TRUE(source->from_the_beginning());
  const Played played = play(*source);
  EXPECT_EQ(played.frames, (Frames{0, 1, 4, 5}));
  EXPECT_TRUE(played.bad.empty());
  EXPECT_EQ(source->damage(), "");
  FrameMemory memory(info);
  EXPECT_EQ(source->next(memory.frame, 0), Status::end) << "and stays there";
}

TEST(LogSource, AFrameComesWithWhatTheSonarSaid) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    DecisionMessage decision = test::decision_about(0);
    decision.sonar_m = 0.31f;
    ASSERT_EQ(run.add(decision), Status::ok);
    ASSERT_EQ(run.add(1), Status::ok);
  }
  auto source = open(dir.path());
  FrameMemory memory(source->info());
  ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
  EXPECT_EQ(memory.frame.sonar_m, 0.31f);
  ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
  EXPECT_EQ(memory.frame.sonar_m, 0.0f);
}

TEST(LogSource, TheCameraThatIsGivenWins) {
  const test::TempDir dir;
  ASSERT_EQ(LoggedRun(dir.path()).add(0), Status::ok);
  DatasetOptions options;
  options.camera = CameraModel{{20, 21, 16, 12, 0, 0}, {}};
  options.depth_units_per_m = 1000;
  auto source = open(dir.path(), options);
  EXPECT_EQ(source->info().camera.k.fy, 21.0f);
  EXPECT_EQ(source->info().camera.k.width, 32);
  EXPECT_EQ(source->info().camera.distortion.p1, 0.0f);
  EXPECT_EQ(source->info().depth_units_per_m, 1000.0f);
}

TEST(LogSource, GoesThroughTheFilesOfARotatedLog) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    for (uint32_t n = 0; n < 12; ++n) {
      ASSERT_EQ(run.add(n), Status::ok);
      if (n % 4 == 3) run.recorder().rotate();
    }
  }
  ASSERT_TRUE(test::exists(dir.path("log-000003.lcm")));
  EXPECT_EQ(play(*open(dir.path())).frames, (Frames{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
  auto later = open(dir.path("log-000002.lcm"));
  EXPECT_EQ(play(*later).frames, (Frames{4, 5, 6, 7, 8, 9, 10, 11}));
  EXPECT_FALSE(later->from_the_beginning());
  EXPECT_TRUE(contains(later->damage(), "its beginning was deleted")) << later->damage();
}

TEST(LogSource, EndsWhereAnotherRunBegins) {
  const test::TempDir dir;
  { ASSERT_EQ(LoggedRun(dir.path()).add(0), Status::ok); }
  {
    const auto codec = make_lcm_codec();
    SessionMessage session;
    session.utime.us = 5;
    session.width = 32, session.height = 24;
    auto other = LogRecorder::create(LoggedRun::with_frames(), dir.path(), session, *codec);
    ASSERT_TRUE(other) << other.error();
    const FrameMemory memory = test::logged_frame(7);
    ASSERT_EQ((*other)->write(test::decision_about(7), &memory.frame), Status::ok);
  }
  EXPECT_EQ(play(*open(dir.path())).frames, (Frames{0}));
}

TEST(LogSource, SkipsFrames) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    for (uint32_t n = 0; n < 6; ++n) ASSERT_EQ(run.add(test::decision_about(n, n != 1)), Status::ok);
  }
  auto source = open(dir.path());
  source->skip(2);
  EXPECT_EQ(play(*source).frames, (Frames{3, 4, 5}));
  source->skip(1000);
}

TEST(LogSource, SaysWhatTheRunUsedAndTheLogLacks) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    ASSERT_EQ(run.add(0), Status::ok);
    DecisionMessage lacking = test::decision_about(1);
    lacking.new_map = true;
    ASSERT_EQ(run.recorder().write(lacking, nullptr), Status::ok);
    ASSERT_EQ(run.add(2), Status::ok);
    ASSERT_EQ(run.recorder().write(test::decision_about(3), nullptr), Status::ok);
  }
  auto source = open(dir.path());
  FrameMemory memory(source->info());
  ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
  ASSERT_EQ(source->next(memory.frame, 0), Status::bad_data);
  EXPECT_TRUE(contains(source->error(), "frame 1: was used, but is not in the log")) << source->error();
  ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
  EXPECT_TRUE(source->decision().new_map) << "it was given up before a frame that is missing";
  ASSERT_EQ(source->next(memory.frame, 0), Status::bad_data);
  EXPECT_TRUE(contains(source->error(), "frame 3: was used, but the log ends before it")) << source->error();
  EXPECT_EQ(source->next(memory.frame, 0), Status::end);
}

TEST(LogSource, GivesTheOdometryAsItWasUsed) {
  const test::TempDir dir;
  DecisionMessage decision = samples::decision();
  decision.used = true;
  decision.sequence = 0;
  {
    LoggedRun run(dir.path());
    ASSERT_EQ(run.add(decision), Status::ok);
    ASSERT_EQ(run.add(1), Status::ok);
  }
  auto source = open(dir.path());
  FrameMemory memory(source->info());
  ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
  OdometrySample sample;
  ASSERT_EQ(source->odometry()->at(decision.odometry[1].asked, sample), Status::ok);
  EXPECT_EQ(sample.stamp, decision.odometry[1].sample.stamp);
  EXPECT_EQ(
      std::memcmp(&sample.T_odom_body, &decision.odometry[1].sample.T_odom_body, sizeof sample.T_odom_body),
      0);
  EXPECT_EQ(source->odometry()->at(Stamp{1}, sample), Status::timeout) << "nobody asked that";
  ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
  EXPECT_EQ(source->odometry()->at(decision.odometry[1].asked, sample), Status::timeout);
}

TEST(LogSource, AChangedImageIsABadFrame) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    for (uint32_t n = 0; n < 3; ++n) ASSERT_EQ(run.add(n), Status::ok);
  }
  const std::string path = dir.path("log-000001.lcm");
  std::string content = test::read_text(path);
  const size_t second = content.find("STILLMAP_FRAME", content.find("STILLMAP_FRAME") + 1);
  content[second + 300] ^= 4;
  test::write_text(path, content);
  auto source = open(path);
  const Played played = play(*source);
  EXPECT_EQ(played.frames, (Frames{0, 2}));
  ASSERT_EQ(played.bad.size(), 1u);
  EXPECT_TRUE(contains(played.bad[0], "frame 1: the checksum is wrong")) << played.bad[0];
}

TEST(LogSource, NoDamageMakesItCrashOrGiveOutAWrongFrame) {
  const test::TempDir dir;
  {
    LoggedRun run(dir.path());
    for (uint32_t n = 0; n < 5; ++n) ASSERT_EQ(run.add(n), Status::ok);
  }
  const std::string whole = test::read_text(dir.path("log-000001.lcm"));
  std::mt19937 random(11);
  int opened = 0;
  for (int round = 0; round < 150; ++round) {
    std::string content = whole;
    for (int flip = 0; flip < 1 + round % 12; ++flip)
      content[random() % content.size()] = static_cast<char>(random());
    if (round % 5 == 0) content.resize(random() % content.size());
    auto source = LogSource::open(dir.write("damaged.lcm", content), {});
    if (!source) continue;
    ++opened;
    const Intrinsics& k = (*source)->info().camera.k;
    if (k.width == 32 && k.height == 24) play(**source);
  }
  EXPECT_GT(opened, 75);
}

TEST(LogSource, SaysWhyALogCannotBePlayed) {
  const test::TempDir dir;
  const auto refused = [&](const std::string& path, const char* why) {
    const auto source = LogSource::open(path, {});
    ASSERT_FALSE(source) << path;
    EXPECT_EQ(source.error_kind(), ErrorKind::cannot_open);
    EXPECT_TRUE(contains(source.error(), why)) << source.error();
  };
  refused(dir.path("missing.lcm"), "there is no such file");
  refused(dir.write("text.lcm", "text"), "is no LCM event log");
  refused(dir.path(), "holds no event log");
  RecordConfig record;
  { ASSERT_EQ(LoggedRun(dir / "poses", record).recorder().write(samples::pose()), Status::ok); }
  refused(dir.path("poses"), "holds no frames; they are in the log of a run with record.frames = true");
  LcmLogOptions options;
  options.dir = dir.path("foreign");
  {
    auto writer = LcmLogWriter::open(options);
    ASSERT_TRUE(writer);
    ASSERT_EQ((*writer)->write("LASER", Utime{}, {}), Status::ok);
  }
  refused(dir.path("foreign"), "is no log of this program");
}

}  // namespace
}  // namespace stillmap
