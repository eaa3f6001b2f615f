#include "runtime/evaluate/accuracy.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "runtime/evaluate/accuracy_bars.hpp"
#include "runtime/evaluate/accuracy_files.hpp"
#include "runtime/evaluate/accuracy_table.hpp"

namespace stillmap {
namespace {

AccuracyRun run_of(const std::string& scene, const std::string& preset, double ate_m, uint64_t seed = 1) {
  AccuracyRun run;
  run.scene = scene;
  run.source = "synthetic:" + scene;
  run.preset = preset;
  run.seed = seed;
  run.synthetic = true;
  if (scene == "crowd" || scene == "balloon") run.twin = scene + "-static";
  run.figures.ate_rmse_m = ate_m;
  return run;
}

const Bar& bar_of(const std::vector<Bar>& bars, const std::string& begin) {
  for (const Bar& bar : bars)
    if (bar.what.starts_with(begin)) return bar;
  ADD_FAILURE() << "no bar begins with " << begin;
  return bars.front();
}

constexpr const char* kMovers = "dynamic scenes: ATE at most 1.3";
constexpr const char* kMean = "dynamic scenes: geometric mean";

TEST(Accuracy, MedianAndWorstOverTheSeeds) {
  std::vector<AccuracyRun> runs;
  for (const auto& [seed, ate_m] : {std::pair{1, 0.01}, {2, 0.05}, {3, 0.02}})
    runs.push_back(run_of("crowd", "default", ate_m, static_cast<uint64_t>(seed)));
  runs[1].figures.mask_iou = 0.7;
  runs[2].figures.mask_iou = 0.9;
  runs.push_back(run_of("static", "default", 0.003));
  const auto all = summarise(runs);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].runs, 3u);
  EXPECT_DOUBLE_EQ(all[0].median.ate_rmse_m, 0.02);
  EXPECT_DOUBLE_EQ(all[0].worst.ate_rmse_m, 0.05);
  EXPECT_DOUBLE_EQ(all[0].median.mask_iou, 0.8);  // of those that know it
  EXPECT_DOUBLE_EQ(all[0].worst.mask_iou, 0.7);
  EXPECT_TRUE(std::isnan(all[1].median.mask_iou));
}

TEST(Accuracy, ATwinHasTheSamePresetAndSeed) {
  std::vector<AccuracyRun> runs = {run_of("crowd", "default", 0.04, 2),
                                   run_of("crowd-static", "default", 0.01, 1),
                                   run_of("crowd-static", "paper", 0.005, 2)};
  relate_to_twins(runs);
  EXPECT_TRUE(std::isnan(runs[0].figures.ate_to_twin));
  runs.push_back(run_of("crowd-static", "default", 0.02, 2));
  relate_to_twins(runs);
  EXPECT_DOUBLE_EQ(runs[0].figures.ate_to_twin, 2);
}

TEST(AccuracyBars, MoversAgainstTheirTwins) {
  std::vector<AccuracyRun> runs = {run_of("crowd", "default", 0.0159),
                                   run_of("crowd-static", "default", 0.01)};
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), kMovers).verdict, Verdict::passed);
  runs[0].figures.ate_rmse_m = 0.0161;
  const Bar bar = bar_of(judge(runs, "default", "paper"), kMovers);
  EXPECT_EQ(bar.verdict, Verdict::failed);
  EXPECT_NEAR(bar.limit, 1.6, 1e-9);
  EXPECT_EQ(bar.scene, "crowd");
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), kMean).verdict, Verdict::unknown);  // no paper preset
}

TEST(AccuracyBars, TheMedianIsNotTheWorst) {
  std::vector<AccuracyRun> runs;
  for (const uint64_t seed : {1u, 2u, 3u})
    runs.push_back(run_of("static", "default", seed == 2 ? 0.009 : 0.002, seed));
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "static scenes: ATE under").verdict,
            Verdict::median_only);
  runs[0].figures.ate_rmse_m = 0.01;
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "static scenes: ATE under").verdict, Verdict::failed);
}

TEST(AccuracyBars, AFailedRunMissesItsBars) {
  std::vector<AccuracyRun> runs = {run_of("static", "default", NAN)};
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "static scenes: ATE under").verdict, Verdict::unknown);
  runs[0].error = "the run failed";
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "static scenes: ATE under").verdict, Verdict::failed);
}

TEST(AccuracyBars, MeansAreGeometric) {
  std::vector<AccuracyRun> runs = {run_of("crowd", "default", 0.01), run_of("crowd", "paper", 0.09),
                                   run_of("balloon", "default", 0.02), run_of("balloon", "paper", 0.02)};
  const Bar bar = bar_of(judge(runs, "default", "paper"), kMean);
  EXPECT_NEAR(bar.value, 1.0 / 3.0, 1e-12);
  EXPECT_NEAR(dynamic_mean_m(runs, "paper"), std::sqrt(0.09 * 0.02), 1e-12);
}

TEST(AccuracyBars, CalibrationIsPooledOverScenes) {
  std::vector<AccuracyRun> runs = {run_of("crowd", "default", 0.01), run_of("static", "default", 0.01)};
  runs[0].figures.good = 100;
  runs[0].figures.good_off = 1;
  runs[1].figures.good = 300;
  runs[1].figures.good_off = 0;
  const auto bars = judge(runs, "default", "paper");
  EXPECT_EQ(bar_of(bars, "at least 99.5 %").verdict, Verdict::passed);
  EXPECT_NEAR(bar_of(bars, "at least 99.5 %").value, 99.75, 1e-9);
  EXPECT_EQ(bar_of(bars, "covariance").verdict, Verdict::unknown);
}

TEST(AccuracyBars, CoveredMayBeLost) {
  std::vector<AccuracyRun> runs = {run_of("covered,size=320x240", "default", 0.01)};
  runs[0].figures.declared_loss = 90;
  runs[0].figures.in_view = 100;
  runs[0].figures.in_view_good = 10;
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "static scenes: ATE under").verdict, Verdict::unknown);
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "at least 97 %").verdict, Verdict::unknown);
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "no declared loss").verdict, Verdict::unknown);
  runs.push_back(run_of("static", "default", 0.01));
  runs[1].figures.declared_loss = 1;
  EXPECT_EQ(bar_of(judge(runs, "default", "paper"), "no declared loss").verdict, Verdict::failed);
}

TEST(AccuracyFiles, CsvAndJsonHoldEveryFigure) {
  std::vector<AccuracyRun> runs = {run_of("crowd", "default", 0.0125)};
  runs[0].error = "two\n\"lines\"";
  const std::string csv = accuracy_csv(runs);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2);
  const std::string head = csv.substr(0, csv.find('\n'));
  EXPECT_EQ(std::count(head.begin(), head.end(), ','), std::count(csv.begin(), csv.end(), ',') / 2);
  EXPECT_NE(csv.find(",0.0125,"), std::string::npos);
  const auto json = nlohmann::json::parse(accuracy_json(runs));
  EXPECT_EQ(json["runs"][0]["ate_rmse_m"], 0.0125);
  EXPECT_TRUE(json["runs"][0]["mask_iou"].is_null());
  EXPECT_EQ(json["summary"][0]["failed"], 1);
  EXPECT_FALSE(json["bars"].empty());
}

TEST(AccuracyTable, PresetsSideBySide) {
  std::vector<AccuracyRun> runs;
  for (const uint64_t seed : {1u, 2u, 3u}) {
    runs.push_back(run_of("crowd", "default", 0.01 * static_cast<double>(seed), seed));
    runs.push_back(run_of("crowd", "paper", 0.1, seed));
  }
  const std::string text = accuracy_markdown(runs);
  EXPECT_NE(text.find("| `crowd` | 2.00 (3.00) | 10.00 (10.00) |"), std::string::npos) << text;
  EXPECT_NE(text.find("default 2.00 cm (0.20 of that of paper), paper 10.00 cm."), std::string::npos) << text;
  EXPECT_NE(text.find("### Bars of `default` (yardstick: `paper`)"), std::string::npos);
  EXPECT_NE(text.find("### Bars of `paper`\n"), std::string::npos);
  EXPECT_NE(text.find("a third of the yardstick's | - | - | - | not measured |"), std::string::npos);
}

TEST(AccuracyTable, MeansAreOverTheScenesThatBothHave) {
  const std::vector<AccuracyRun> runs = {run_of("crowd", "default", 0.02), run_of("crowd", "paper", 0.1),
                                         run_of("balloon", "default", 5)};
  const std::string text = accuracy_markdown(runs);
  EXPECT_NE(text.find("default 2.00 cm (0.20 of that of paper)"), std::string::npos) << text;
}

}  // namespace
}  // namespace stillmap
