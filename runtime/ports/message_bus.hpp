#pragma once

#include "runtime/ports/messages.hpp"

namespace stillmap {

/// Where encoded messages go: a network. Drivers implement it.
class MessageBus {
 public:
  virtual ~MessageBus() = default;

  /// @param channel ended by 0  @param bytes at most kDatagramBytes
  /// @return ok; unavailable: not sent (no route, link down), the next may be
  /// @thread publish; never blocks, neither allocates nor throws
  virtual Status publish(const char* channel, View<const uint8_t> bytes) = 0;
};

/// Commands that came in; drivers implement it.
class CommandPort {
 public:
  virtual ~CommandPort() = default;

  /// @return ok; timeout: there is none.  @thread supervisor; neither waits nor allocates
  virtual Status next(CommandMessage& command) = 0;
  /// Messages on our channels that are none of ours or out of range, since the start.
  virtual uint32_t refused() const = 0;
};

}  // namespace stillmap
