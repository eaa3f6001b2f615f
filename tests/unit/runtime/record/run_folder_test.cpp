#include "runtime/record/run_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "runtime/record/output_file.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using test::exists;
using test::read_text;
using test::TempDir;

void leave_run(const std::string& dir, const std::string& mark) {
  ASSERT_EQ(write_whole_file(dir + "/trajectory.txt", mark), "");
  ASSERT_EQ(write_whole_file(dir + "/events.log.part", mark), "");
  std::filesystem::create_directories(dir + "/masks");
  ASSERT_EQ(write_whole_file(dir + "/masks/0.000000.png", mark), "");
}

TEST(RunFolder, IsMadeWithItsParents) {
  TempDir dir;
  const auto folder = RunFolder::open(dir.path("a/b/c"), 3);
  ASSERT_TRUE(folder) << folder.error();
  EXPECT_TRUE(std::filesystem::is_directory(dir.path("a/b/c")));
  EXPECT_TRUE(std::filesystem::is_empty(dir.path("a/b/c")));  // the probe is gone
}

TEST(RunFolder, MovesEarlierRunsAndKeepsTheNewestOnes) {
  TempDir dir;
  for (const std::string mark : {"first", "second", "third", "fourth"}) {
    ASSERT_TRUE(RunFolder::open(dir.path(), 2));
    EXPECT_FALSE(exists(dir.path("trajectory.txt")));
    EXPECT_FALSE(exists(dir.path("events.log.part")));
    leave_run(dir.path(), mark);
  }
  EXPECT_EQ(read_text(dir.path("trajectory.txt")), "fourth");
  EXPECT_EQ(read_text(dir.path("previous-1/trajectory.txt")), "third");
  EXPECT_EQ(read_text(dir.path("previous-1/masks/0.000000.png")), "third");
  EXPECT_EQ(read_text(dir.path("previous-2/trajectory.txt")), "second");
  EXPECT_FALSE(exists(dir.path("previous-3")));
}

TEST(RunFolder, TakesOverAnEventLogThatWasNotClosed) {
  TempDir dir;
  dir.write("log-000001.lcm", "closed");
  dir.write("log-000002.lcm.part", "not closed");
  const auto folder = RunFolder::open(dir.path(), 1);
  ASSERT_TRUE(folder) << folder.error();
  EXPECT_EQ(folder->unclosed_logs(), 1u);
  EXPECT_EQ(read_text(dir.path("previous-1/log-000001.lcm")), "closed");
  EXPECT_EQ(read_text(dir.path("previous-1/log-000002.lcm")), "not closed");
}

TEST(RunFolder, FewerKeptRemovesTheOlderOnes) {
  TempDir dir;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(RunFolder::open(dir.path(), 3));
    leave_run(dir.path(), std::to_string(i));
  }
  ASSERT_TRUE(RunFolder::open(dir.path(), 1));
  EXPECT_EQ(read_text(dir.path("previous-1/trajectory.txt")), "3");
  EXPECT_FALSE(exists(dir.path("previous-2")));
  EXPECT_FALSE(exists(dir.path("previous-3")));
}

TEST(RunFolder, KeepNoneRemovesTheEarlierRun) {
  TempDir dir;
  leave_run(dir.path(), "old");
  ASSERT_TRUE(RunFolder::open(dir.path(), 0));
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

TEST(RunFolder, LeavesOtherFilesAlone) {
  TempDir dir;
  leave_run(dir.path(), "old");
  ASSERT_EQ(write_whole_file(dir.path("notes.md"), "mine"), "");
  ASSERT_TRUE(RunFolder::open(dir.path(), 0));
  EXPECT_EQ(read_text(dir.path("notes.md")), "mine");
}

TEST(RunFolder, FileInTheWayIsNamed) {
  TempDir dir;
  ASSERT_EQ(write_whole_file(dir.path("file"), "x"), "");
  for (const std::string name : {"file", "file/below"}) {
    const auto folder = RunFolder::open(dir.path(name), 3);
    ASSERT_FALSE(folder);
    EXPECT_EQ(folder.error().rfind(dir.path(name) + ": ", 0), 0u) << folder.error();
  }
}

TEST(RunFolder, FolderThatCannotBeWrittenIsNamedWithTheReason) {
  // Nobody, root included, makes files in /proc.
  const auto folder = RunFolder::open("/proc/stillmap-run", 3);
  ASSERT_FALSE(folder);
  EXPECT_NE(folder.error().find("/proc/stillmap-run: cannot be made"), std::string::npos) << folder.error();
  const auto there = RunFolder::open("/proc", 3);
  ASSERT_FALSE(there);
  EXPECT_NE(there.error().find("/proc: cannot be written to"), std::string::npos) << there.error();
}

}  // namespace
}  // namespace stillmap
