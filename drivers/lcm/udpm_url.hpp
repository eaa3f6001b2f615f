#pragma once

#include <cstdint>
#include <string>

#include "config/result.hpp"

namespace stillmap {

/// LCM over UDP multicast.
struct UdpmUrl {
  uint32_t group = 0xEFFF4C43;  ///< 239.255.76.67, host byte order
  uint16_t port = 7667;
  uint8_t ttl = 0;                   ///< 0: this host, 1: its networks
  int32_t receive_buffer_bytes = 0;  ///< asked of the system; 0: its default
};

/// udpm://[GROUP][:PORT][?ttl=N][&recv_buf_size=BYTES], as LCM has it.
/// @return kind bad_usage: what was expected.  @thread any
Result<UdpmUrl> parse_udpm_url(const std::string& url);

}  // namespace stillmap
