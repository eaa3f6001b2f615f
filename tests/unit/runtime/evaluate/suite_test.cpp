#include "runtime/evaluate/suite.hpp"

#include <algorithm>
#include <sstream>

#include <gtest/gtest.h>

#include "runtime/evaluate/paper_tables.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

constexpr const char* kTruth = "1 0 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n3 2 2 0 0 0 0 1\n4 0 2 0 0 0 0 1\n";
constexpr const char* kHalfLarger = "1 0 0 0 0 0 0 1\n2 3 0 0 0 0 0 1\n3 3 3 0 0 0 0 1\n4 0 3 0 0 0 0 1\n";

TEST(PaperSequence, IsReadFromTheFolder) {
  EXPECT_EQ(paper_sequence_of("rgbd_dataset_freiburg3_walking_xyz"), "walking_xyz");
  EXPECT_EQ(paper_sequence_of("rgbd_bonn_balloon"), "balloon");
  EXPECT_EQ(paper_sequence_of("rgbd_bonn_balloon2"), "balloon2");
  EXPECT_EQ(paper_sequence_of("rgbd_bonn_balloon_tracking"), "balloon_tracking");
  EXPECT_EQ(paper_sequence_of("rgbd_bonn_moving_obstructing_box2"), "moving_obstructing_box2");
  EXPECT_EQ(paper_sequence_of("rgbd_bonn_moving_nonobstructing_box"), "moving_nonobstructing_box");
  EXPECT_EQ(paper_sequence_of("rgbd_bonn_balloon9"), "");
  EXPECT_EQ(paper_sequence_of("rgbd_dataset_freiburg3_walking_xyz_validation"), "");
  EXPECT_EQ(paper_sequence_of("rgbd_dataset_freiburg1_desk"), "");
}

TEST(PaperTables, HaveThePapersLargestErrors) {
  const auto worst = [](const auto& table, double PaperRow::*column) {
    double value = 0;
    for (const PaperRow& row : table) value = std::max(value, row.*column);
    return value;
  };
  EXPECT_EQ(worst(kPaperTum, &PaperRow::refusion_m), 0.110);
  EXPECT_EQ(worst(kPaperTum, &PaperRow::static_fusion_m), 0.681);
  EXPECT_EQ(worst(kPaperTum, &PaperRow::dynaslam_g_m), 0.085);
  EXPECT_EQ(worst(kPaperTum, &PaperRow::dynaslam_ng_m), 0.028);
  EXPECT_EQ(worst(kPaperTum, &PaperRow::mask_fusion_m), 0.106);
  EXPECT_EQ(worst(kPaperBonn, &PaperRow::refusion_m), 0.571);
  EXPECT_EQ(worst(kPaperBonn, &PaperRow::static_fusion_m), 3.586);
  EXPECT_EQ(worst(kPaperBonn, &PaperRow::dynaslam_g_m), 1.217);
  EXPECT_EQ(worst(kPaperBonn, &PaperRow::dynaslam_ng_m), 0.575);
}

class Suite : public ::testing::Test {
 protected:
  void sequence(const std::string& name) {
    dir_.write(name + "/depth.txt", "");
    dir_.write(name + "/groundtruth.txt", kTruth);
  }
  std::string line_of(const std::string& text, const std::string& name) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
      if (line.rfind(name + " ", 0) == 0) return line;
    return {};
  }
  test::TempDir dir_;
};

TEST_F(Suite, SetsOursBesideThePaper) {
  sequence("rgbd_dataset_freiburg3_walking_xyz");
  sequence("bonn/rgbd_bonn_balloon2");
  sequence("bonn/rgbd_bonn_crowd");
  const std::string good = dir_.write("good.txt", kTruth), bad = dir_.write("bad.txt", kHalfLarger);
  std::vector<std::string> called;
  const SuiteRun run = [&](const std::string& sequence, const std::string& config) -> Result<std::string> {
    called.push_back(sequence + " " + config);
    if (sequence.find("crowd") != std::string::npos) return Error{"the run broke"};
    return config == "conf/paper.toml" ? bad : good;
  };
  const auto result = evaluate_suite(dir_.path(""), {"conf/default.toml", "conf/paper.toml"}, run);
  ASSERT_TRUE(result) << result.error();
  EXPECT_EQ(called.size(), 6u);
  EXPECT_EQ(result->evaluated, 4u);
  EXPECT_EQ(result->failed, 2u);
  const std::string xyz = line_of(result->text, "walking_xyz");
  for (const char* figure : {"0.099", "0.093", "0.085", "0.017", "0.104", "0.000", "0.707"})
    EXPECT_NE(xyz.find(figure), std::string::npos) << figure << " in " << xyz;
  EXPECT_NE(line_of(result->text, "balloon2").find("0.707"), std::string::npos);
  EXPECT_EQ(line_of(result->text, "balloon").back(), '-');
  EXPECT_NE(line_of(result->text, "crowd").find("failed"), std::string::npos);
  EXPECT_NE(result->text.find("the run broke"), std::string::npos);
}

TEST_F(Suite, RunsTheDefaultWithoutConfigs) {
  sequence("rgbd_bonn_synchronous");
  const std::string good = dir_.write("good.txt", kTruth);
  const auto result =
      evaluate_suite(dir_.path("rgbd_bonn_synchronous"), {},
                     [&](const std::string&, const std::string& config) -> Result<std::string> {
                       EXPECT_EQ(config, "");
                       return good;
                     });
  ASSERT_TRUE(result);
  EXPECT_EQ(result->evaluated, 1u);
}

TEST_F(Suite, SaysWhenThereIsNothing) {
  const SuiteRun run = [](const std::string&, const std::string&) -> Result<std::string> {
    return Error{"not called"};
  };
  const auto empty = evaluate_suite(dir_.path(""), {}, run);
  ASSERT_FALSE(empty);
  EXPECT_NE(empty.error().find("none of the paper's sequences"), std::string::npos);
  EXPECT_FALSE(evaluate_suite(dir_.path("missing"), {}, run));
}

}  // namespace
}  // namespace stillmap
