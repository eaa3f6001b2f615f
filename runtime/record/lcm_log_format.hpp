#pragma once

// LCM's event log: events without gaps, each a head, the channel's name and the payload. Numbers are big
// endian.

#include <cstdint>
#include <cstring>

#include "kernels/base/view.hpp"

namespace stillmap::lcm_log {

/// Where an event begins.
inline constexpr uint32_t kSync = 0xeda1da01;
/// sync u32, event number i64, utime i64, bytes of the channel's name i32, bytes of the payload i32
inline constexpr uint32_t kHeadBytes = 28;
/// Of a channel's name; LCM's own limit.
inline constexpr uint32_t kMaxChannel = 63;
/// No event of ours is near it; what says it is longer, is damaged.
inline constexpr uint32_t kMaxPayload = 64 << 20;

struct Head {
  int64_t number = 0;
  int64_t utime_us = 0;
  uint32_t channel_bytes = 0;
  uint32_t payload_bytes = 0;
};

inline void put_big_endian(uint64_t value, uint32_t bytes, uint8_t* to) {
  for (uint32_t i = 0; i < bytes; ++i) to[i] = static_cast<uint8_t>(value >> (8 * (bytes - 1 - i)));
}

inline uint64_t big_endian(const uint8_t* from, uint32_t bytes) {
  uint64_t value = 0;
  for (uint32_t i = 0; i < bytes; ++i) value = value << 8 | from[i];
  return value;
}

/// @param to kHeadBytes
inline void put_head(const Head& head, uint8_t* to) {
  put_big_endian(kSync, 4, to);
  put_big_endian(static_cast<uint64_t>(head.number), 8, to + 4);
  put_big_endian(static_cast<uint64_t>(head.utime_us), 8, to + 12);
  put_big_endian(head.channel_bytes, 4, to + 20);
  put_big_endian(head.payload_bytes, 4, to + 24);
}

inline bool is_sync(const uint8_t* from) {
  return big_endian(from, 4) == kSync;
}

/// @param from kHeadBytes  @return false: that is no head, or no sensible one
inline bool get_head(const uint8_t* from, Head& head) {
  if (!is_sync(from)) return false;
  head.number = static_cast<int64_t>(big_endian(from + 4, 8));
  head.utime_us = static_cast<int64_t>(big_endian(from + 12, 8));
  head.channel_bytes = static_cast<uint32_t>(big_endian(from + 20, 4));
  head.payload_bytes = static_cast<uint32_t>(big_endian(from + 24, 4));
  return head.channel_bytes >= 1 && head.channel_bytes <= kMaxChannel && head.payload_bytes <= kMaxPayload;
}

}  // namespace stillmap::lcm_log
