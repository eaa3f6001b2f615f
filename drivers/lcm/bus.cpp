#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <thread>

#include "drivers/lcm/datagram.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/lcm/udp_socket.hpp"
#include "drivers/lcm/udpm_url.hpp"

namespace stillmap {
namespace {

/// Keeps a sending socket a member of its own group. Linux holds datagrams of ttl 0 back within the host only
/// on devices with a member of the group; without one they leave.
class Membership {
 public:
  Membership(const UdpSocket& socket, uint32_t group) : socket_(socket), group_(group) {
    join();
    thread_ = std::jthread([this](const std::stop_token& stop) { keep(stop); });
  }

  bool holds() const { return holds_.load(std::memory_order_relaxed); }

 private:
  void join() { holds_.store(join_group(socket_, group_), std::memory_order_relaxed); }
  void keep(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      never_.wait_for(lock, stop, kJoinEvery, [] { return false; });
      join();
    }
  }

  const UdpSocket& socket_;
  uint32_t group_;
  std::atomic<bool> holds_{false};
  std::mutex mutex_;
  std::condition_variable_any never_;  ///< nothing but the stop wakes it up; allocates when it is made
  std::jthread thread_;  ///< last: it uses all the others
};

class LcmBus final : public MessageBus {
 public:
  LcmBus(UdpSocket socket, const UdpmUrl& url) : socket_(std::move(socket)) {
    to_.sin_family = AF_INET;
    to_.sin_port = htons(url.port);
    to_.sin_addr.s_addr = htonl(url.group);
    if (url.ttl == 0) within_host_.emplace(socket_, url.group);
  }

  Status publish(const char* channel, View<const uint8_t> bytes) override {
    const size_t channel_bytes = std::strlen(channel) + 1;
    if (channel_bytes > lcm_wire::kLongestChannel + 1 || bytes.size > kDatagramBytes)
      return Status::out_of_range;
    if (within_host_ && !within_host_->holds()) return Status::unavailable;
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
  std::optional<Membership> within_host_;  ///< of ttl 0; last: its thread uses the socket
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
