#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <cerrno>
#include <cstring>

#include "drivers/lcm/datagram.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/lcm/udp_socket.hpp"
#include "drivers/lcm/udpm_url.hpp"

namespace stillmap {
namespace {

class LcmBus final : public MessageBus {
 public:
  LcmBus(UdpSocket socket, const UdpmUrl& url) : socket_(std::move(socket)) {
    to_.sin_family = AF_INET;
    to_.sin_port = htons(url.port);
    to_.sin_addr.s_addr = htonl(url.group);
  }

  Status publish(const char* channel, View<const uint8_t> bytes) override {
    const size_t channel_bytes = std::strlen(channel) + 1;
    if (channel_bytes > lcm_wire::kLongestChannel + 1 || bytes.size > kDatagramBytes)
      return Status::out_of_range;
    uint32_t header[2] = {htonl(lcm_wire::kShortMagic), htonl(sequence_++)};
    iovec parts[3] = {{header, sizeof header},
                      {const_cast<char*>(channel), channel_bytes},  // sendmsg writes to none of them
                      {const_cast<uint8_t*>(bytes.data), bytes.size}};
    msghdr message{};
    message.msg_name = &to_;
    message.msg_namelen = sizeof to_;
    message.msg_iov = parts;
    message.msg_iovlen = std::size(parts);
    // The group is looked up in the routes anew each time, so a network that comes or comes back is found.
    return sendmsg(socket_.descriptor(), &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0 ? Status::ok
                                                                                     : Status::unavailable;
  }

 private:
  UdpSocket socket_;
  sockaddr_in to_{};
  uint32_t sequence_ = 0;
};

}  // namespace

Result<std::unique_ptr<MessageBus>> open_lcm_bus(const std::string& url) {
  const Result<UdpmUrl> parsed = parse_udpm_url(url);
  if (!parsed) return Error{parsed.error(), parsed.error_kind()};
  UdpSocket socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const int loop = 1;  // to other programs on this host
  if (!socket ||
      setsockopt(socket.descriptor(), IPPROTO_IP, IP_MULTICAST_TTL, &parsed->ttl, sizeof parsed->ttl) != 0 ||
      setsockopt(socket.descriptor(), IPPROTO_IP, IP_MULTICAST_LOOP, &loop, sizeof loop) != 0)
    return Error{"LCM URL '" + url + "': no socket to publish with: " + std::strerror(errno)};
  return std::unique_ptr<MessageBus>(std::make_unique<LcmBus>(std::move(socket), *parsed));
}

}  // namespace stillmap
