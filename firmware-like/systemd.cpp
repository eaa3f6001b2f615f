#include "firmware-like/systemd.hpp"

#include <systemd/sd-daemon.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>

namespace stillmap {
namespace {

class Systemd final : public ServiceManager {
 public:
  Systemd() {
    uint64_t watchdog_us = 0;
    if (sd_watchdog_enabled(0, &watchdog_us) > 0) period_ = std::chrono::microseconds(watchdog_us / 3);
  }
  void ready() override { sd_notify(0, "READY=1"); }
  void stopping() override { sd_notify(0, "STOPPING=1"); }
  void alive() override {
    const auto now = Clock::now();
    if (period_.count() == 0 || now < due_) return;
    due_ = now + period_;
    sd_notify(0, "WATCHDOG=1");
  }
  void say(const std::string& status) override { sd_notify(0, ("STATUS=" + status).c_str()); }

 private:
  using Clock = std::chrono::steady_clock;
  std::chrono::microseconds period_{0};
  Clock::time_point due_;
};

}  // namespace

std::unique_ptr<ServiceManager> systemd_service() {
  if (std::getenv("NOTIFY_SOCKET") == nullptr) return nullptr;
  return std::make_unique<Systemd>();
}

}  // namespace stillmap
