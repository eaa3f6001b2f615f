#include "drivers/lcm/udpm_url.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>

namespace stillmap {
namespace {

/// @return false: not a whole number, or outside low..high
template <class T>
bool read_number(std::string_view text, T low, T high, T& number) {
  long long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high) return false;
  number = static_cast<T>(value);
  return true;
}

bool read_group(const std::string& text, uint32_t& group) {
  in_addr address{};
  if (inet_pton(AF_INET, text.c_str(), &address) != 1) return false;
  group = ntohl(address.s_addr);
  return group >> 28 == 0xE;  // 224.0.0.0 to 239.255.255.255
}

bool read_option(std::string_view option, UdpmUrl& parsed) {
  const size_t equals = option.find('=');
  if (equals == std::string_view::npos) return false;
  const std::string_view name = option.substr(0, equals), value = option.substr(equals + 1);
  if (name == "ttl") return read_number<uint8_t>(value, 0, 255, parsed.ttl);
  if (name == "recv_buf_size") return read_number(value, 1, 1 << 28, parsed.receive_buffer_bytes);
  return false;
}

}  // namespace

Result<UdpmUrl> parse_udpm_url(const std::string& url) {
  const auto refused = [&](const std::string& why) {
    return Error{
        fmt::format("LCM URL '{}': {}; expected udpm://GROUP:PORT[?ttl=N][&recv_buf_size=BYTES], for "
                    "example udpm://239.255.76.67:7667?ttl=1",
                    url, why),
        ErrorKind::bad_usage};
  };
  constexpr std::string_view kScheme = "udpm://";
  if (url.compare(0, kScheme.size(), kScheme) != 0) return refused("only LCM over UDP multicast is spoken");
  const size_t question = std::min(url.find('?'), url.size());
  const std::string network = url.substr(kScheme.size(), question - kScheme.size());
  const size_t colon = std::min(network.find(':'), network.size());

  UdpmUrl parsed;
  const std::string group = network.substr(0, colon);
  if (!group.empty() && !read_group(group, parsed.group))
    return refused(fmt::format("'{}' is no multicast address", group));
  if (colon < network.size()) {
    const std::string port = network.substr(colon + 1);
    if (!read_number<uint16_t>(port, 1, 65535, parsed.port))
      return refused(fmt::format("'{}' is no port", port));
  }
  for (size_t at = question + 1; at < url.size();) {
    const std::string option = url.substr(at, url.find('&', at) - at);
    if (!read_option(option, parsed))
      return refused(fmt::format("'{}' is no option, or its number out of range", option));
    at += option.size() + 1;
  }
  return parsed;
}

}  // namespace stillmap
