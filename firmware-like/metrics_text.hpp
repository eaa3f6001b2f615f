#pragma once

#include <string>

#include "runtime/ports/messages.hpp"

namespace stillmap {

/// A status as Prometheus text (exposition format 0.0.4): names begin with stillmap_, units are SI.
std::string metrics_text(const StatusMessage& status);

}  // namespace stillmap
