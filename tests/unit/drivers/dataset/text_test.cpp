#include "drivers/dataset/text.hpp"

#include <gtest/gtest.h>

#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

TEST(StampLabel, HasSixDigits) {
  EXPECT_EQ(stamp_label(Stamp{1305031229528748000}), "1305031229.528748");
  EXPECT_EQ(stamp_label(Stamp{333333333}), "0.333333");
}

TEST(TextFile, PassesOverCommentsAndEmptyLines) {
  const test::TempDir dir;
  test::write_text(dir / "list.txt", "# stamp file\r\n\r\n1.0 a.png\r\n  # more\n\n2.0\tb.png extra\n3.0");
  const Result<TextFile> file = TextFile::read(dir / "list.txt");
  ASSERT_TRUE(file);
  const auto lines = file->lines();
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].number, 3u);
  EXPECT_EQ(lines[0].words, (std::vector<std::string_view>{"1.0", "a.png"}));
  EXPECT_EQ(lines[1].number, 6u);
  EXPECT_EQ(lines[1].words.size(), 3u);
  EXPECT_EQ(lines[2].words.size(), 1u);
  EXPECT_FALSE(TextFile::read(dir / "none.txt"));
}

}  // namespace
}  // namespace stillmap
