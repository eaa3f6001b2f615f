#include "drivers/dataset/text.hpp"

#include <gtest/gtest.h>

#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

int64_t ns(const char* text) {
  const auto stamp = parse_stamp(text);
  EXPECT_TRUE(stamp) << text;
  return stamp ? stamp->ns : -1;
}

TEST(ParseStamp, KeepsEveryNanosecond) {
  EXPECT_EQ(ns("1305031229.528748"), 1305031229528748000);
  EXPECT_EQ(ns("1305031229.528748123"), 1305031229528748123);
  EXPECT_EQ(ns("1548266469.88633"), 1548266469886330000);
  EXPECT_EQ(ns("0.333333"), 333333000);
  EXPECT_EQ(ns(".5"), 500000000);
  EXPECT_EQ(ns("7."), 7000000000);
  EXPECT_EQ(ns("7"), 7000000000);
  EXPECT_EQ(ns("0"), 0);
  EXPECT_EQ(ns("-1.5"), -1500000000);
}

TEST(ParseStamp, RoundsWhatIsFiner) {
  EXPECT_EQ(ns("1.0000000004"), 1000000000);
  EXPECT_EQ(ns("1.0000000005"), 1000000001);
  EXPECT_EQ(ns("1.999999999999999999999999999999"), 2000000000);
}

TEST(ParseStamp, ReadsExponents) {
  EXPECT_EQ(ns("1.305031229528748e+09"), 1305031229528748000);
  EXPECT_EQ(ns("15E-1"), 1500000000);
  EXPECT_EQ(ns("1e-300"), 0);
}

TEST(ParseStamp, RefusesWhatIsNoStamp) {
  for (const char* text : {"", ".", "-", "1.2.3", "abc", "1.5s", "nan", "inf", "1e", "1e+", "1e99", "0x10",
                           "1 2", "99999999999999999999", "4000000000", "1e99999999999999999999"})
    EXPECT_FALSE(parse_stamp(text)) << text;
}

TEST(StampText, HasSixDigits) {
  EXPECT_EQ(stamp_text(Stamp{1305031229528748000}), "1305031229.528748");
  EXPECT_EQ(stamp_text(Stamp{333333333}), "0.333333");
}

TEST(ParseNumber, TakesWholeFiniteNumbersOnly) {
  EXPECT_EQ(parse_number("5.850000000000000000e+02"), 585.0);
  EXPECT_EQ(parse_number("+1"), 1.0);
  for (const char* text : {"", "nan", "inf", "1e999", "1x", "--1"}) EXPECT_FALSE(parse_number(text)) << text;
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
