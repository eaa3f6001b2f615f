#include "runtime/evaluate/trajectory.hpp"

#include <cmath>
#include <cstdlib>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

TEST(ExactSeconds, IsTheDoubleThatAScriptReads) {
  std::mt19937_64 random(1);
  std::uniform_int_distribution<int64_t> micros(0, 2'000'000'000'000'000);
  for (int i = 0; i < 10000; ++i) {
    const Stamp stamp{micros(random) * 1000};
    EXPECT_EQ(exact_seconds(stamp), std::strtod(stamp_text(stamp).c_str(), nullptr)) << stamp.ns;
  }
}

TEST(StampText, RoundTrips) {
  for (const int64_t ns : {int64_t{0}, int64_t{1}, int64_t{1305031229123456789}, int64_t{-1500000000}})
    EXPECT_EQ(parse_stamp(stamp_text(Stamp{ns})), Stamp{ns}) << ns;
}

class ReadTrajectory : public ::testing::Test {
 protected:
  Result<Trajectory> read(const std::string& text) { return read_trajectory(dir_.write("t.txt", text)); }
  void expect_error(const std::string& text, const std::string& part) {
    const auto result = read(text);
    ASSERT_FALSE(result) << text.substr(0, 80);
    EXPECT_NE(result.error().find(part), std::string::npos) << result.error();
    EXPECT_NE(result.error().find("t.txt"), std::string::npos) << result.error();
    EXPECT_EQ(result.error().find('\n'), std::string::npos);
  }
  test::TempDir dir_;
};

TEST_F(ReadTrajectory, ReadsCommentsBlankLinesAndSeparators) {
  const auto result = read(
      "# stamp tx ty tz qx qy qz qw\n\n"
      "2.0,4,5,6,0,0,0,1  # note\r\n"
      "  1.5\t1 2 3 0 0 0.7071067811865476 0.7071067811865476\r\n"
      "   \n"
      "3 7 8 9 0 0 0 -2");  // no end of line, quaternion of length 2
  ASSERT_TRUE(result) << result.error();
  ASSERT_EQ(result->poses.size(), 3u);
  EXPECT_EQ(result->poses[0].stamp.ns, 1500000000);  // sorted
  EXPECT_EQ(result->poses[0].T_world_cam.translation.z, 3);
  EXPECT_NEAR(result->poses[0].T_world_cam.rotation(0, 1), -1, 1e-12);
  EXPECT_EQ(result->poses[1].T_world_cam.translation.x, 4);
  EXPECT_NEAR(result->poses[2].T_world_cam.rotation(0, 0), 1, 1e-12);
}

TEST_F(ReadTrajectory, KeepsTheLastOfEqualStamps) {
  const auto result = read("1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n1.000 3 0 0 0 0 0 1\n");
  ASSERT_TRUE(result);
  ASSERT_EQ(result->poses.size(), 2u);
  EXPECT_EQ(result->poses[0].T_world_cam.translation.x, 3);
  EXPECT_EQ(result->repeated_stamps, 1u);
}

TEST_F(ReadTrajectory, NamesFileAndLineOfWhatIsWrong) {
  const std::string good = "1 0 0 0 0 0 0 1\n";
  expect_error(good + "2 0 nan 0 0 0 0 1\n", ":2: column 3, 'nan'");
  expect_error(good + "2 0 inf 0 0 0 0 1\n", ":2: column 3");
  expect_error(good + "2 0 1e999 0 0 0 0 1\n", ":2: column 3");
  expect_error(good + "#\n2 0 0 0 0 0 1\n", ":3: has 7 columns");
  expect_error(good + "2 0 0 0 0 0 0 1 5\n", ":2: has 9 columns");
  expect_error(good + "2 0 0 0 0 0 0 0\n", ":2: the quaternion");
  expect_error(good + "2 0 0 0 1e308 1e308 1e308 1e308\n", ":2: the quaternion");
  expect_error(good + "x 0 0 0 0 0 0 1\n", ":2: stamp 'x'");
  expect_error(good + "2 0 0 1e9 0 0 0 1\n", ":2: position");
  expect_error(good + std::string(5000, ' ') + "\n", ":2: the line is longer");
  expect_error(good + std::string(5000, ' '), ":2: the line is longer");
  expect_error("", "holds no pose");
  expect_error("# only a comment\n", "holds no pose");
}

TEST_F(ReadTrajectory, RefusesFoldersAndMissingFiles) {
  const auto folder = read_trajectory(dir_.path(""));
  ASSERT_FALSE(folder);
  EXPECT_NE(folder.error().find("folder"), std::string::npos);
  const auto missing = read_trajectory(dir_.path("missing.txt"));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().find("missing.txt"), std::string::npos);
}

TEST(ParsePose, ReadsSevenNumbers) {
  const auto pose = parse_pose("1,-2,3,0,0,1,0");
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->translation.y, -2);
  EXPECT_NEAR(pose->rotation(0, 0), -1, 1e-12);
  for (const char* text : {"", "1,2,3", "1,2,3,0,0,0,0", "1,2,3,0,0,0,1,9", "a,2,3,0,0,0,1"})
    EXPECT_FALSE(parse_pose(text)) << text;
}

}  // namespace
}  // namespace stillmap
