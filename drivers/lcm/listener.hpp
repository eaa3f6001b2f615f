#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

#include "config/result.hpp"
#include "drivers/lcm/udp_socket.hpp"
#include "drivers/lcm/udpm_url.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

/// Hears LCM messages on a thread of its own, which allocates nothing.
class LcmListener {
 public:
  /// Called on the listening thread with every message of one datagram, of any channel; the payload is
  /// unchecked and gone after the call. Must not throw.
  using Handler = std::function<void(std::string_view channel, View<const uint8_t> payload)>;

  /// @return kind bad_usage: not a URL; failed: the port is taken by a program that does not share it.
  /// @thread boot
  static Result<std::unique_ptr<LcmListener>> open(const std::string& url, Handler handler);

  /// Ends within a tenth of a second.
  ~LcmListener() = default;

  /// A member of the group: false while no network has a route to it.  @thread any
  bool connected() const { return connected_.load(std::memory_order_relaxed); }

 private:
  LcmListener(UdpSocket socket, const UdpmUrl& url, Handler handler);
  void join();
  void listen(const std::stop_token& stop);
  void receive();

  UdpSocket socket_;
  UdpmUrl url_;
  Handler handler_;
  std::atomic<bool> connected_{false};
  std::jthread thread_;  ///< last: it uses all the others
};

}  // namespace stillmap
