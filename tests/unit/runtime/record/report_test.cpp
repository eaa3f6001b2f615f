#include "runtime/record/report.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace stillmap {
namespace {

FrameResult frame(float total_ms, float masked_fraction) {
  FrameResult result;
  result.ms = {1, 2, 3, 4, 5, total_ms};
  result.masked_fraction = masked_fraction;
  result.map.blocks = 10;
  result.map.capacity = 100;
  result.map.bytes = 12345;
  return result;
}

TEST(Report, HasEveryKeyOfTheContract) {
  Report report("cpu", 2, 1000);
  for (int i = 1; i <= 100; ++i) report.add(frame(static_cast<float>(i), 0.5f), 0.0905);
  PipelineCounters counters;
  counters.frames = 100;
  counters.lost_frames = 3;
  counters.relocalised = 1;
  report.set_counters(counters);
  report.set_faults({{"bad_frame", 2}});
  report.set_heap_allocations(0);
  const auto json = nlohmann::json::parse(report.json());

  EXPECT_EQ(json.at("device"), "cpu");
  EXPECT_EQ(json.at("threads"), 2);
  EXPECT_EQ(json.at("frames"), 100);
  EXPECT_EQ(json.at("dropped"), 0);
  EXPECT_EQ(json.at("lost_frames"), 3);
  EXPECT_EQ(json.at("relocalised"), 1);
  EXPECT_EQ(json.at("heap_allocations_in_loop"), 0);
  EXPECT_EQ(json.at("deadline_misses"), 10);  // 91..100 ms
  EXPECT_DOUBLE_EQ(json.at("masked_fraction_mean"), 0.5);
  EXPECT_EQ(json.at("faults").at("bad_frame"), 2);
  EXPECT_FALSE(json.at("version").get<std::string>().empty());
  for (const char* step : {"prepare", "track", "mask", "refine", "integrate", "total"})
    for (const char* figure : {"mean", "p50", "p95", "p99", "max"})
      EXPECT_TRUE(json.at("ms").at(step).at(figure).is_number()) << step << " " << figure;
  EXPECT_NEAR(json.at("ms").at("total").at("p50").get<double>(), 50, 0.3);
  EXPECT_EQ(json.at("ms").at("total").at("max"), 100);
  EXPECT_EQ(json.at("map").at("blocks"), 10);
  EXPECT_EQ(json.at("map").at("free_blocks"), 90);
  EXPECT_EQ(json.at("map").at("capacity"), 100);
  EXPECT_EQ(json.at("map").at("bytes"), 12345);
  EXPECT_EQ(json.at("map").at("archived"), 0);
  EXPECT_EQ(json.at("memory").at("planned_bytes"), 1000);
  EXPECT_GT(json.at("memory").at("peak_rss_bytes").get<uint64_t>(), 1000000u);
}

TEST(Report, UnusedFramesDoNotEnterTheTimes) {
  Report report("cpu", 2, 1000);
  report.add(frame(10, 0.2f), 0);
  FrameResult bad = frame(0, 0);
  bad.status = Status::bad_data;
  report.add(bad, 0);
  const auto json = nlohmann::json::parse(report.json());
  EXPECT_EQ(json.at("ms").at("total").at("mean"), 10);
  EXPECT_NEAR(json.at("masked_fraction_mean").get<double>(), 0.2, 1e-6);
}

TEST(Report, OfNothingIsStillValid) {
  const auto json = nlohmann::json::parse(Report("cpu", 1, 0).json());
  EXPECT_EQ(json.at("frames"), 0);
  EXPECT_EQ(json.at("masked_fraction_mean"), 0);
  EXPECT_TRUE(json.at("faults").is_object());
}

}  // namespace
}  // namespace stillmap
