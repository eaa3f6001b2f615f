#include "runtime/core/crc32c.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace stillmap {
namespace {

uint32_t of(const std::string& text) {
  return crc32c(text.data(), text.size());
}

TEST(Crc32c, KnownAnswers) {
  EXPECT_EQ(of(""), 0u);
  EXPECT_EQ(of("123456789"), 0xe3069283u);            // the check value of its definition
  EXPECT_EQ(of(std::string(32, '\0')), 0x8a9136aau);  // RFC 3720, B.4
  EXPECT_EQ(of(std::string(32, '\xff')), 0x62a8ab43u);
}

TEST(Crc32c, GoesOnWhereverItWasInterrupted) {
  std::string text;
  for (int i = 0; i < 61; ++i) text += static_cast<char>(i * 37);
  for (size_t cut = 0; cut <= text.size(); ++cut)
    EXPECT_EQ(crc32c(text.data() + cut, text.size() - cut, crc32c(text.data(), cut)), of(text)) << cut;
}

}  // namespace
}  // namespace stillmap
