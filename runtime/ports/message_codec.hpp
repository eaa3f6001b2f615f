#pragma once

#include "runtime/ports/messages.hpp"

namespace stillmap {

/// Messages to bytes of the wire and back; drivers implement it. Stateless.
/// @thread any; encode and decode neither allocate nor throw
class MessageCodec {
 public:
  virtual ~MessageCodec() = default;

  /// @return bytes written; 0: `to` is too short
  virtual uint32_t encode(const PoseMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const StatusMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const RangeMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const CommandMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const FrameMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const DecisionMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const SessionMessage& message, View<uint8_t> to) const = 0;
  virtual uint32_t encode(const EventMessage& message, View<uint8_t> to) const = 0;

  /// Views and strings of a decoded message point into `from`.
  /// @return bad_data: not that type, too short, or a value outside its range; `message` is unchanged
  virtual Status decode(View<const uint8_t> from, PoseMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, StatusMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, RangeMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, CommandMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, FrameMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, DecisionMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, SessionMessage& message) const = 0;
  virtual Status decode(View<const uint8_t> from, EventMessage& message) const = 0;
};

/// The longest message but frame_t and session_t, in bytes: one datagram.
inline constexpr uint32_t kDatagramBytes = 1400;

}  // namespace stillmap
