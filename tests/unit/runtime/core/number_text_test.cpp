#include "runtime/core/number_text.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

int64_t ns_of(const char* text) {
  const auto stamp = parse_stamp(text);
  EXPECT_TRUE(stamp) << text;
  return stamp ? stamp->ns : -1;
}

TEST(ParseStamp, IsExactToTheNanosecond) {
  EXPECT_EQ(ns_of("1305031229.4331"), 1305031229433100000);
  EXPECT_EQ(ns_of("1305031229.123456789"), 1305031229123456789);
  EXPECT_EQ(ns_of("0.033333"), 33333000);
  EXPECT_EQ(ns_of("1548266469.88633"), 1548266469886330000);
  EXPECT_EQ(ns_of("0"), 0);
  EXPECT_EQ(ns_of("000012.5"), 12500000000);
  EXPECT_EQ(ns_of(".25"), 250000000);
  EXPECT_EQ(ns_of("7."), 7000000000);
  EXPECT_EQ(ns_of("-1.5"), -1500000000);
  EXPECT_EQ(ns_of("+2"), 2000000000);
}

TEST(ParseStamp, ReadsExponentsAndRoundsWhatIsFiner) {
  EXPECT_EQ(ns_of("1.305031229433099985e+09"), 1305031229433099985);
  EXPECT_EQ(ns_of("1.305031910e+09"), 1305031910000000000);
  EXPECT_EQ(ns_of("12E-3"), 12000000);
  EXPECT_EQ(ns_of("0.0000000015"), 2);
  EXPECT_EQ(ns_of("0.00000000149"), 1);
  EXPECT_EQ(ns_of("0.0000000005"), 1);
  EXPECT_EQ(ns_of("1e-30"), 0);
  EXPECT_EQ(ns_of("1.999999999999999999999999999999"), 2000000000);
}

TEST(ParseStamp, RefusesWhatIsNoNumber) {
  for (const char* text :
       {"", ".", "-", "abc", "1.2.3", "1e", "1e+", "e5", "nan", "inf", "1x", "0x10", "1e300", "99999999999",
        "4000000000", "99999999999999999999", "1e99999999999999999999"})
    EXPECT_FALSE(parse_stamp(text)) << text;
}

TEST(ParseNumber, TakesTheWholeTextOrNothing) {
  EXPECT_EQ(parse_number("+1.5e2").value_or(0), 150.0);
  EXPECT_EQ(parse_number("-0.25").value_or(0), -0.25);
  for (const char* text : {"", "+", "+-1", "1 ", "1,5", "nan", "inf", "1e999", "--1", "0x10"})
    EXPECT_FALSE(parse_number(text)) << text;
}

}  // namespace
}  // namespace stillmap
