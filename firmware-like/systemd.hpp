#pragma once

#include <memory>

#include "runtime/ports/service_manager.hpp"

namespace stillmap {

/// systemd, where it started the program as a service of type notify ($NOTIFY_SOCKET), else null. Tells it
/// that the program is alive as often as its watchdog asks for.
std::unique_ptr<ServiceManager> systemd_service();

}  // namespace stillmap
