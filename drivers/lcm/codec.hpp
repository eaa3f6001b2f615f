#pragma once

#include "runtime/ports/message_codec.hpp"

namespace stillmap {

/// The types of drivers/lcm/types. Ours instead of lcm-gen's because those decode strings and arrays into
/// memory that they allocate, by sizes that nobody checked; a test compares the bytes.
class LcmCodec final : public MessageCodec {
 public:
  uint32_t encode(const PoseMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const StatusMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const RangeMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const CommandMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const FrameMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const DecisionMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const SessionMessage& message, View<uint8_t> to) const override;
  uint32_t encode(const EventMessage& message, View<uint8_t> to) const override;

  Status decode(View<const uint8_t> from, PoseMessage& message) const override;
  Status decode(View<const uint8_t> from, StatusMessage& message) const override;
  Status decode(View<const uint8_t> from, RangeMessage& message) const override;
  Status decode(View<const uint8_t> from, CommandMessage& message) const override;
  Status decode(View<const uint8_t> from, FrameMessage& message) const override;
  Status decode(View<const uint8_t> from, DecisionMessage& message) const override;
  Status decode(View<const uint8_t> from, SessionMessage& message) const override;
  Status decode(View<const uint8_t> from, EventMessage& message) const override;
};

}  // namespace stillmap
