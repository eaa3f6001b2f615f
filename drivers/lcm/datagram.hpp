#pragma once

// LCM's messages in datagrams: "LC02", sequence number (uint32_t, big endian), channel ended by 0, payload.
// Messages too long for one come as "LC03" fragments.

#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include "kernels/base/view.hpp"
#include "runtime/ports/message_codec.hpp"

namespace stillmap::lcm_wire {

inline constexpr uint32_t kShortMagic = 0x4C433032, kFragmentMagic = 0x4C433033;
inline constexpr uint32_t kShortHeaderBytes = 8, kFragmentHeaderBytes = 20;
inline constexpr uint32_t kLongestChannel = 63;

struct Message {
  std::string_view channel;
  View<const uint8_t> payload;  ///< empty of fragments: none of our messages is that long
};

inline uint32_t big_endian(const uint8_t* bytes) {
  return uint32_t{bytes[0]} << 24 | uint32_t{bytes[1]} << 16 | uint32_t{bytes[2]} << 8 | bytes[3];
}

/// @return nothing: not of LCM, or a fragment but the first, which alone names the channel
inline std::optional<Message> parse(View<const uint8_t> datagram) {
  if (datagram.size < kShortHeaderBytes) return std::nullopt;
  const uint32_t magic = big_endian(datagram.data);
  const bool fragment = magic == kFragmentMagic;
  if (!fragment && magic != kShortMagic) return std::nullopt;
  const uint32_t header = fragment ? kFragmentHeaderBytes : kShortHeaderBytes;
  if (datagram.size < header) return std::nullopt;
  constexpr uint32_t kFragmentNumberAt = 16;  // uint16_t, and after it their number
  if (fragment && big_endian(datagram.data + kFragmentNumberAt) >> 16 != 0) return std::nullopt;

  const uint8_t* channel = datagram.data + header;
  const auto* end = static_cast<const uint8_t*>(std::memchr(channel, 0, datagram.size - header));
  if (!end || end - channel > kLongestChannel) return std::nullopt;
  Message message;
  message.channel = {reinterpret_cast<const char*>(channel), static_cast<size_t>(end - channel)};
  if (!fragment) message.payload = {end + 1, static_cast<uint32_t>(datagram.end() - (end + 1))};
  return message;
}

}  // namespace stillmap::lcm_wire
