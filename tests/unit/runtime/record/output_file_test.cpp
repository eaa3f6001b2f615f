#include "runtime/record/output_file.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/temp_dir.hpp"
#include "tests/unit/runtime/record/file_size_limit.hpp"

namespace stillmap {
namespace {

using test::exists;
using test::FileSizeLimit;
using test::read_text;
using test::TempDir;

TEST(OutputFile, StreamEndsInPartUntilClosed) {
  TempDir dir;
  auto file = OutputFile::create(dir.path("log.txt"), OutputFile::Kind::stream);
  ASSERT_TRUE(file) << file.error();
  ASSERT_TRUE(file->write("one\n"));
  EXPECT_EQ(read_text(dir.path("log.txt.part")), "one\n");  // a reader sees every record at once
  EXPECT_FALSE(exists(dir.path("log.txt")));
  ASSERT_TRUE(file->close());
  EXPECT_EQ(read_text(dir.path("log.txt")), "one\n");
  EXPECT_FALSE(exists(dir.path("log.txt.part")));
}

TEST(OutputFile, WholeFileThatIsNotClosedLeavesNothingAndTheOldOneStays) {
  TempDir dir;
  ASSERT_EQ(write_whole_file(dir.path("a"), "old"), "");
  {
    auto file = OutputFile::create(dir.path("a"), OutputFile::Kind::whole);
    ASSERT_TRUE(file);
    ASSERT_TRUE(file->write("new"));
  }
  EXPECT_EQ(read_text(dir.path("a")), "old");
  EXPECT_FALSE(exists(dir.path("a.part")));
}

TEST(OutputFile, FullDiskKeepsTheWholeRecordsOfAStream) {
  TempDir dir;
  auto file = OutputFile::create(dir.path("log.txt"), OutputFile::Kind::stream);
  ASSERT_TRUE(file);
  {
    FileSizeLimit full(25);
    EXPECT_TRUE(file->write("0123456789\n"));
    EXPECT_TRUE(file->write("0123456789\n"));
    EXPECT_FALSE(file->write("0123456789\n"));  // three bytes of it would fit
    EXPECT_FALSE(file->write("more\n"));
  }
  EXPECT_NE(file->error().find(dir.path("log.txt")), std::string::npos) << file->error();
  EXPECT_NE(file->error().find("File too large"), std::string::npos) << file->error();
  EXPECT_FALSE(file->close());  // the failure is not forgotten
  EXPECT_EQ(read_text(dir.path("log.txt")), "0123456789\n0123456789\n");
}

TEST(OutputFile, FullDiskRemovesAHalfWholeFile) {
  TempDir dir;
  FileSizeLimit full(1000);
  const std::string error = write_whole_file(dir.path("mesh"), std::string(2000, 'x'));
  EXPECT_NE(error.find("mesh: cannot be written"), std::string::npos) << error;
  EXPECT_FALSE(exists(dir.path("mesh")));
  EXPECT_FALSE(exists(dir.path("mesh.part")));
}

TEST(OutputFile, DeviceWithoutSpaceIsReported) {
  TempDir dir;
  std::filesystem::create_symlink("/dev/full", dir.path("log.txt.part"));
  auto file = OutputFile::create(dir.path("log.txt"), OutputFile::Kind::stream);
  ASSERT_TRUE(file);
  EXPECT_FALSE(file->write("one\n"));
  EXPECT_NE(file->error().find("No space left"), std::string::npos) << file->error();
}

TEST(OutputFile, PathThatCannotBeMadeNamesPathAndReason) {
  const auto file = OutputFile::create("/nonexistent-folder/x", OutputFile::Kind::whole);
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error(), "/nonexistent-folder/x: cannot be written: No such file or directory");
}

TEST(OutputFile, BigWholeFileComesOutByteForByte) {
  TempDir dir;
  std::string content;
  auto file = OutputFile::create(dir.path("big"), OutputFile::Kind::whole);
  ASSERT_TRUE(file);
  for (int i = 0; i < 100000; ++i) {
    const std::string record = std::to_string(i) + ",";
    content += record;
    ASSERT_TRUE(file->write(record));
  }
  const std::string block(600000, 'b');  // larger than the buffer
  ASSERT_TRUE(file->write(block));
  ASSERT_TRUE(file->close());
  EXPECT_EQ(read_text(dir.path("big")), content + block);
}

TEST(OutputFile, AStreamThatIsFullGoesOnInTheNextFile) {
  const test::TempDir dir;
  const std::string path = dir.path("states.csv");
  {
    auto file = OutputFile::create(path, OutputFile::Kind::stream);
    ASSERT_TRUE(file) << file.error();
    ASSERT_TRUE(file->write("head\n"));
    file->rotate_at(25, 2, "head\n");  // the header and two records
    for (int i = 0; i < 9; ++i) ASSERT_TRUE(file->write("record " + std::to_string(i) + "\n"));
    EXPECT_TRUE(file->close());
  }
  EXPECT_EQ(read_text(path), "head\nrecord 8\n");
  EXPECT_EQ(read_text(path + ".1"), "head\nrecord 6\nrecord 7\n");
  EXPECT_EQ(read_text(path + ".2"), "head\nrecord 4\nrecord 5\n");
  EXPECT_FALSE(std::filesystem::exists(path + ".3"));
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
}

}  // namespace
}  // namespace stillmap
