#include "drivers/lcm/udpm_url.hpp"

#include <gtest/gtest.h>

#include "drivers/lcm/lcm.hpp"

namespace stillmap {
namespace {

TEST(UdpmUrl, ReadsEveryPart) {
  const auto url = parse_udpm_url("udpm://224.1.2.3:65000?ttl=2&recv_buf_size=8388608");
  ASSERT_TRUE(url);
  EXPECT_EQ(url->group, 0xE0010203u);
  EXPECT_EQ(url->port, 65000);
  EXPECT_EQ(url->ttl, 2);
  EXPECT_EQ(url->receive_buffer_bytes, 8388608);
}

TEST(UdpmUrl, WhatIsLeftOutIsLcmsDefault) {
  for (const char* text :
       {"udpm://", "udpm://239.255.76.67", "udpm://:7667", "udpm://?ttl=0", kLcmDefaultUrl}) {
    const auto url = parse_udpm_url(text);
    ASSERT_TRUE(url) << text;
    EXPECT_EQ(url->group, 0xEFFF4C43u);
    EXPECT_EQ(url->port, 7667);
    EXPECT_EQ(url->ttl, 0);
  }
}

TEST(UdpmUrl, SaysWhatIsWrong) {
  const std::pair<const char*, const char*> kWrong[] = {
      {"", "only LCM over UDP"},
      {"tcpq://127.0.0.1:7700", "only LCM over UDP"},
      {"memq://", "only LCM over UDP"},
      {"udpm://127.0.0.1:7667", "'127.0.0.1' is no multicast address"},
      {"udpm://240.0.0.1", "'240.0.0.1' is no multicast address"},
      {"udpm://robot:7667", "'robot' is no multicast address"},
      {"udpm://239.255.76.67:", "'' is no port"},
      {"udpm://239.255.76.67:0", "'0' is no port"},
      {"udpm://239.255.76.67:65536", "'65536' is no port"},
      {"udpm://239.255.76.67:7667x", "'7667x' is no port"},
      {"udpm://239.255.76.67:7667?ttl=256", "'ttl=256' is no option"},
      {"udpm://239.255.76.67:7667?ttl=-1", "'ttl=-1' is no option"},
      {"udpm://239.255.76.67:7667?ttl", "'ttl' is no option"},
      {"udpm://239.255.76.67:7667?ttl=1&hops=2", "'hops=2' is no option"}};
  for (const auto& [text, why] : kWrong) {
    const auto url = parse_udpm_url(text);
    ASSERT_FALSE(url) << text;
    EXPECT_EQ(url.error_kind(), ErrorKind::bad_usage);
    EXPECT_NE(url.error().find(why), std::string::npos) << url.error();
    EXPECT_NE(url.error().find("expected udpm://"), std::string::npos) << url.error();
  }
}

TEST(UdpmUrl, NothingOpensWithAWrongOne) {
  EXPECT_EQ(open_lcm_bus("off").error_kind(), ErrorKind::bad_usage);
  EXPECT_EQ(open_lcm_commands("off").error_kind(), ErrorKind::bad_usage);
  EXPECT_EQ(open_lcm_odometry("off", [](Utime) { return Stamp{}; }).error_kind(), ErrorKind::bad_usage);
}

}  // namespace
}  // namespace stillmap
