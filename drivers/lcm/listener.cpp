#include "drivers/lcm/listener.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "drivers/lcm/datagram.hpp"

namespace stillmap {
namespace {

constexpr int kPollMs = 100;

sockaddr_in address_of(const UdpmUrl& url) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(url.port);
  address.sin_addr.s_addr = htonl(url.group);  // not any address: other groups' datagrams stay away
  return address;
}

/// @return none, with errno set, when the system refuses
UdpSocket bound_socket(const UdpmUrl& url) {
  UdpSocket socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket) return {};
  const int yes = 1, buffer = url.receive_buffer_bytes;
  const sockaddr_in address = address_of(url);
  if (setsockopt(socket.descriptor(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
      (buffer > 0 && setsockopt(socket.descriptor(), SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer) != 0) ||
      bind(socket.descriptor(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return {};
  return socket;
}

}  // namespace

Result<std::unique_ptr<LcmListener>> LcmListener::open(const std::string& url, Handler handler) {
  const Result<UdpmUrl> parsed = parse_udpm_url(url);
  if (!parsed) return Error{parsed.error(), parsed.error_kind()};
  UdpSocket socket = bound_socket(*parsed);
  if (!socket) return Error{"LCM URL '" + url + "': cannot listen: " + std::strerror(errno)};
  return std::unique_ptr<LcmListener>(new LcmListener(std::move(socket), *parsed, std::move(handler)));
}

LcmListener::LcmListener(UdpSocket socket, const UdpmUrl& url, Handler handler)
    : socket_(std::move(socket)), url_(url), handler_(std::move(handler)) {
  join();
  thread_ = std::jthread([this](const std::stop_token& stop) { listen(stop); });
}

void LcmListener::join() {
  connected_.store(join_group(socket_, url_.group), std::memory_order_relaxed);
}

void LcmListener::listen(const std::stop_token& stop) {
  auto joined = std::chrono::steady_clock::now();
  while (!stop.stop_requested()) {
    pollfd readable{socket_.descriptor(), POLLIN, 0};
    if (poll(&readable, 1, kPollMs) > 0) receive();
    if (std::chrono::steady_clock::now() - joined < kJoinEvery) continue;
    joined = std::chrono::steady_clock::now();
    join();
  }
}

void LcmListener::receive() {
  std::array<uint8_t, 2048> datagram;  // a longer one is cut, and so no message of ours
  const ssize_t bytes = recv(socket_.descriptor(), datagram.data(), datagram.size(), 0);
  if (bytes <= 0) return;
  if (const auto message = lcm_wire::parse({datagram.data(), static_cast<uint32_t>(bytes)}))
    handler_(message->channel, message->payload);
}

}  // namespace stillmap
