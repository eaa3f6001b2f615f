#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "config/result.hpp"
#include "runtime/ports/messages.hpp"

namespace stillmap {

/// Serves the newest status as Prometheus text on 127.0.0.1, one caller after the other; a caller that is
/// slow is dropped after a second.
/// @thread show: supervisor; the server has its own
class MetricsServer {
 public:
  /// @return an error that names the port.  @thread boot
  static Result<std::unique_ptr<MetricsServer>> open(int32_t port);
  ~MetricsServer();
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;

  void show(const StatusMessage& status);

 private:
  explicit MetricsServer(int socket);
  void serve();
  void answer(int caller);

  const int socket_;
  std::mutex mutex_;
  StatusMessage status_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace stillmap
