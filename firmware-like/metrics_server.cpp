#include "firmware-like/metrics_server.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>

#include "firmware-like/metrics_text.hpp"

namespace stillmap {
namespace {

constexpr int kWaitMs = 100;  ///< how long a stop may go unseen

void send_all(int socket, std::string_view text) {
  while (!text.empty()) {
    const ssize_t sent = send(socket, text.data(), text.size(), MSG_NOSIGNAL);
    if (sent <= 0) return;
    text.remove_prefix(static_cast<size_t>(sent));
  }
}

}  // namespace

Result<std::unique_ptr<MetricsServer>> MetricsServer::open(int32_t port) {
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int on = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  constexpr int kBacklog = 4;
  if (listener >= 0 && bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0 &&
      listen(listener, kBacklog) == 0)
    return std::unique_ptr<MetricsServer>(new MetricsServer(listener));
  const int error = errno;
  if (listener >= 0) close(listener);
  return Error{fmt::format("metrics.port = {}: {}; choose another one or 0", port, std::strerror(error)),
               ErrorKind::bad_usage};
}

MetricsServer::MetricsServer(int socket) : socket_(socket), thread_([this] { serve(); }) {}

MetricsServer::~MetricsServer() {
  stop_ = true;
  thread_.join();
  close(socket_);
}

void MetricsServer::show(const StatusMessage& status) {
  const std::lock_guard lock(mutex_);
  status_ = status;
}

void MetricsServer::serve() {
  while (!stop_) {
    pollfd waiting{socket_, POLLIN, 0};
    if (poll(&waiting, 1, kWaitMs) <= 0) continue;
    const int caller = accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC);
    if (caller < 0) continue;
    const timeval second{1, 0};
    setsockopt(caller, SOL_SOCKET, SO_RCVTIMEO, &second, sizeof(second));
    setsockopt(caller, SOL_SOCKET, SO_SNDTIMEO, &second, sizeof(second));
    answer(caller);
    close(caller);
  }
}

void MetricsServer::answer(int caller) {
  char request[1024];
  const ssize_t length = recv(caller, request, sizeof(request), 0);
  if (length <= 0) return;
  const std::string_view line(request, static_cast<size_t>(length));
  if (!line.starts_with("GET /metrics ") && !line.starts_with("GET / "))
    return send_all(caller, "HTTP/1.0 404 Not Found\r\nContent-Length: 0\r\n\r\n");
  StatusMessage status;
  {
    const std::lock_guard lock(mutex_);
    status = status_;
  }
  const std::string body = metrics_text(status);
  send_all(
      caller,
      fmt::format("HTTP/1.0 200 OK\r\nContent-Type: text/plain; version=0.0.4\r\nContent-Length: {}\r\n\r\n",
                  body.size()));
  send_all(caller, body);
}

}  // namespace stillmap
