#pragma once

#include "runtime/ports/messages.hpp"

namespace stillmap {

inline constexpr char kPoseChannel[] = "STILLMAP_POSE", kStatusChannel[] = "STILLMAP_STATUS",
                      kRangeChannel[] = "STILLMAP_RANGE", kCommandChannel[] = "STILLMAP_COMMAND",
                      kOdometryChannel[] = "ODOMETRY";

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
  /// Messages on the channel that are no commands, or came while too many others waited, since the start.
  /// @thread any
  virtual uint32_t refused() const = 0;
};

}  // namespace stillmap
