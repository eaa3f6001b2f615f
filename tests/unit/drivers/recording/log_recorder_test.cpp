#include "runtime/record/log_recorder.hpp"

#include <gtest/gtest.h>

#include "runtime/core/heap_guard.hpp"
#include "runtime/record/lcm_log_reader.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/fake_disk.hpp"
#include "tests/support/logged_run.hpp"
#include "tests/support/sample_messages.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using test::FrameMemory;
using test::LoggedRun;

std::vector<std::string> channels_of(const std::string& path) {
  std::vector<std::string> channels;
  auto reader = LcmLogReader::open(path);
  EXPECT_TRUE(reader) << reader.error();
  for (LogEvent event; reader && reader->next(event);) channels.emplace_back(event.channel);
  return channels;
}

/// Decodes the only event of that channel.
template <class Message>
Message read(const std::string& path, const char* channel) {
  Message message;
  auto reader = LcmLogReader::open(path);
  int found = 0;
  for (LogEvent event; reader && reader->next(event);)
    if (event.channel == channel) {
      ++found;
      EXPECT_EQ(make_lcm_codec()->decode(event.payload, message), Status::ok);
      EXPECT_EQ(event.utime, message.utime);
    }
  EXPECT_EQ(found, 1);
  return message;
}

TEST(LogRecorder, WritesEveryKindOfMessageBehindTheSession) {
  const test::TempDir dir;
  RecordConfig record;
  LoggedRun run(dir.path(), record);
  LogRecorder& log = run.recorder();
  EXPECT_EQ(log.write(samples::pose()), Status::ok);
  EXPECT_EQ(log.write(samples::status()), Status::ok);
  EXPECT_EQ(log.write(samples::range()), Status::ok);
  EXPECT_EQ(log.write(samples::command()), Status::ok);
  EXPECT_EQ(log.write(samples::event()), Status::ok);
  EXPECT_EQ(log.write_odometry(samples::pose()), Status::ok);
  EXPECT_EQ(run.add(1), Status::ok) << "frames were not asked for";
  ASSERT_TRUE(log.close());
  const std::string path = dir.path("log-000001.lcm");
  EXPECT_EQ(channels_of(path),
            (std::vector<std::string>{"STILLMAP_SESSION", "STILLMAP_POSE", "STILLMAP_STATUS",
                                      "STILLMAP_RANGE", "STILLMAP_COMMAND", "STILLMAP_EVENT", "ODOMETRY"}));
  EXPECT_EQ(read<StatusMessage>(path, log_channel::kStatus).frame, samples::status().frame);
  EXPECT_EQ(read<PoseMessage>(path, log_channel::kPose).pos_m[1], samples::pose().pos_m[1]);
}

TEST(LogRecorder, WritesDecisionsBeforeTheirFrames) {
  const test::TempDir dir;
  LoggedRun run(dir.path());
  EXPECT_EQ(run.add(0), Status::ok);
  EXPECT_EQ(run.add(test::decision_about(1, false)), Status::ok);
  EXPECT_EQ(run.add(2), Status::ok);
  ASSERT_TRUE(run.recorder().close());
  EXPECT_EQ(channels_of(dir.path("log-000001.lcm")),
            (std::vector<std::string>{"STILLMAP_SESSION", "STILLMAP_DECISION", "STILLMAP_FRAME",
                                      "STILLMAP_DECISION", "STILLMAP_DECISION", "STILLMAP_FRAME"}));
}

TEST(LogRecorder, EveryFileOfARunBeginsWithTheSession) {
  const test::TempDir dir;
  RecordConfig record = LoggedRun::with_frames();
  record.log_file_bytes = 200000;
  record.log_max_bytes = 1e6f;
  LoggedRun run(dir.path(), record);
  for (uint32_t n = 0; n < 200; ++n) ASSERT_EQ(run.add(n), Status::ok);
  ASSERT_TRUE(run.recorder().close());
  EXPECT_GE(run.recorder().counters().files_begun, 2u);
  for (const auto& file : std::filesystem::directory_iterator(dir.path()))
    EXPECT_EQ(channels_of(file.path().string()).front(), "STILLMAP_SESSION");
}

TEST(LogRecorder, SaysWhenAFrameDoesNotFitAFile) {
  const test::TempDir dir;
  RecordConfig record = LoggedRun::with_frames();
  record.log_file_bytes = 2000;
  record.log_max_bytes = 1e6f;
  const auto codec = make_lcm_codec();
  SessionMessage session;
  session.width = session.height = 64;
  const auto recorder = LogRecorder::create(record, dir.path(), session, *codec);
  ASSERT_FALSE(recorder);
  EXPECT_EQ(recorder.error_kind(), ErrorKind::bad_usage);
  EXPECT_TRUE(test::contains(recorder.error(), "record.log_file_bytes = 2000")) << recorder.error();
}

TEST(LogRecorder, GoesOnWhenThereIsRoomAgain) {
  test::FakeDisk disk;
  LoggedRun run("d", LoggedRun::with_frames(), disk);
  ASSERT_EQ(run.add(0), Status::ok);
  disk.room = disk.bytes() + 500;
  EXPECT_EQ(run.add(1), Status::capacity_exhausted);
  EXPECT_EQ(run.add(2), Status::capacity_exhausted);
  EXPECT_EQ(run.recorder().status(), Status::capacity_exhausted);
  disk.room = UINT64_MAX;
  disk.time_ns += LcmLogWriter::kRetryNs;
  EXPECT_EQ(run.add(3), Status::ok);
  EXPECT_EQ(run.recorder().status(), Status::ok);
}

TEST(LogRecorder, DoesNotAllocateAfterBoot) {
  if (!heap_guard::counts()) GTEST_SKIP() << "a sanitizer has its own allocator";
  const test::TempDir dir;
  RecordConfig record = LoggedRun::with_frames();
  record.log_file_bytes = 100000;
  record.log_max_bytes = 300000;
  record.log_sync_s = 0.001f;
  LoggedRun run(dir.path(), record);
  std::vector<FrameMemory> frames;
  for (uint32_t n = 0; n < 20; ++n) frames.push_back(test::logged_frame(n));
  const uint64_t before = heap_guard::allocations();
  {
    const heap_guard::Scope armed;
    for (uint32_t n = 0; n < 1000; ++n) {
      run.recorder().write(samples::status());
      run.recorder().write(test::decision_about(n), &frames[n % frames.size()].frame);
      run.recorder().step();
    }
    run.recorder().rotate();
  }
  EXPECT_EQ(heap_guard::allocations(), before);
  EXPECT_EQ(run.recorder().counters().dropped, 0u);
  EXPECT_GT(run.recorder().counters().files_deleted, 2u);
}

/// A day of poses and status at 30 Hz, the time between two events as it would be. (A month would not
/// differ.)
TEST(LogRecorder, ADayStaysWithinItsBytes) {
  test::FakeDisk disk;
  RecordConfig record;
  record.log_max_bytes = 20e6f;
  record.log_file_bytes = 2e6f;
  LoggedRun run("d", record, disk);
  PoseMessage pose = samples::pose();
  StatusMessage status = samples::status();
  constexpr int64_t kFrames = 30 * 60 * 60 * 24;
  for (int64_t n = 0; n < kFrames; ++n) {
    disk.time_ns = n * 1'000'000'000 / 30;
    pose.utime.us = status.utime.us = disk.time_ns / 1000;
    ASSERT_EQ(run.recorder().write(pose), Status::ok);
    ASSERT_EQ(run.recorder().write(status), Status::ok);
    run.recorder().step();
  }
  EXPECT_LE(disk.most_bytes, 20'000'000u);
  EXPECT_GE(disk.bytes(), 16'000'000u) << "more was deleted than had to be";
  EXPECT_GE(disk.syncs, 86000u) << "once a second";
  EXPECT_EQ(run.recorder().counters().dropped, 0u);
}

}  // namespace
}  // namespace stillmap
