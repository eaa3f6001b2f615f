#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "runtime/record/events_log.hpp"
#include "runtime/record/states_writer.hpp"
#include "runtime/record/trajectory_writer.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using test::read_text;
using test::TempDir;

auto count_lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

TEST(FileStamp, HasSixDigitsAndLosesNothingOfALargeStamp) {
  EXPECT_EQ(file_stamp(Stamp{0}), "0.000000");
  EXPECT_EQ(file_stamp(Stamp{1305031102175304000}), "1305031102.175304");
  EXPECT_EQ(file_stamp(Stamp{999999600}), "1.000000");
  EXPECT_EQ(file_stamp(Stamp{33333333}), "0.033333");
  EXPECT_EQ(file_stamp(Stamp{-1500000000}), "-1.500000");
  EXPECT_EQ(file_stamp(Stamp{-500}), "-0.000001");
}

TEST(TrajectoryWriter, WritesTumLines) {
  TempDir dir;
  auto writer = TrajectoryWriter::create(dir.path("trajectory.txt"));
  ASSERT_TRUE(writer);
  Se3d T_map_cam;
  T_map_cam.rotation = rotation_from(Quatd{0, 0, 1, 1});
  T_map_cam.translation = {1.5, -2, 0.25};
  ASSERT_TRUE(writer->write(Stamp{0}, Se3d{}));
  ASSERT_TRUE(writer->write(Stamp{1234567000}, T_map_cam));
  ASSERT_TRUE(writer->file().close());
  EXPECT_EQ(
      read_text(dir.path("trajectory.txt")),
      "0.000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 1.000000000\n"
      "1.234567 1.500000000 -2.000000000 0.250000000 0.000000000 0.000000000 0.707106781 0.707106781\n");
}

TEST(StatesWriter, HasTheContractsColumnsAndTheTriangle) {
  TempDir dir;
  auto writer = StatesWriter::create(dir.path("states.csv"));
  ASSERT_TRUE(writer);
  FrameResult result;
  result.stamp = Stamp{2000000000};
  result.state = TrackingState::lost;
  result.p_good = 0.25f;
  result.covariance[0] = 1e-6f;
  result.covariance[20] = 4e-6f;
  ASSERT_TRUE(writer->write(result));
  ASSERT_TRUE(writer->file().close());
  const std::string text = read_text(dir.path("states.csv"));
  const std::string header = text.substr(0, text.find('\n'));
  const std::string line = text.substr(header.size() + 1);
  EXPECT_EQ(header.substr(0, 63), "stamp,state,p_good,inlier_ratio,masked_fraction,cov_x_x,cov_x_y");
  EXPECT_EQ(std::count(header.begin(), header.end(), ','), 25);
  EXPECT_EQ(std::count(line.begin(), line.end(), ','), 25);
  EXPECT_EQ(line.substr(0, 48), "2.000000,lost,0.2500,0.0000,0.0000,1e-06,0,0,0,0");
  EXPECT_EQ(line.substr(line.size() - 7), ",4e-06\n");
}

TEST(TimingWriter, WritesALineAFrame) {
  TempDir dir;
  auto writer = TimingWriter::create(dir.path("timing.csv"));
  ASSERT_TRUE(writer);
  FrameResult result;
  result.stamp = Stamp{1000000000};
  result.ms = {1, 2, 3, 4, 5, 15.5f};
  ASSERT_TRUE(writer->write(result));
  ASSERT_TRUE(writer->file().close());
  EXPECT_EQ(read_text(dir.path("timing.csv")),
            "stamp,prepare_ms,track_ms,mask_ms,refine_ms,integrate_ms,total_ms\n"
            "1.000000,1.0000,2.0000,3.0000,4.0000,5.0000,15.5000\n");
}

TEST(EventsLog, CountsFaultsAndKeepsEachEventOnOneLine) {
  TempDir dir;
  auto log = EventsLog::create(dir.path("events.log"));
  ASSERT_TRUE(log);
  log->info(Stamp{0}, "start", "tum:x");
  log->fault(Stamp{1000000000}, "bad_frame", "a.png:\ntruncated");
  log->fault(Stamp{2000000000}, "bad_frame", "b.png");
  ASSERT_TRUE(log->close());
  EXPECT_EQ(read_text(dir.path("events.log")),
            "0.000000 info start: tum:x\n1.000000 fault bad_frame: a.png: truncated\n"
            "2.000000 fault bad_frame: b.png\n");
  ASSERT_EQ(log->faults().size(), 1u);
  EXPECT_EQ(log->faults().at("bad_frame"), 2u);
}

TEST(EventsLog, AFaultInEveryFrameDoesNotFillTheDisk) {
  TempDir dir;
  auto log = EventsLog::create(dir.path("events.log"));
  ASSERT_TRUE(log);
  for (uint32_t i = 0; i < EventsLog::kMaxLinesPerName + 500; ++i) log->fault(Stamp{0}, "bad_frame", "x");
  log->fault(Stamp{0}, "map_full", "y");
  ASSERT_TRUE(log->close());
  EXPECT_EQ(count_lines(read_text(dir.path("events.log"))), EventsLog::kMaxLinesPerName + 1);
  EXPECT_EQ(log->faults().at("bad_frame"), EventsLog::kMaxLinesPerName + 500);
}

}  // namespace
}  // namespace stillmap
