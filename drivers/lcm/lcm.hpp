#pragma once

// The LCM face of the program: what it says and hears on the network, and how its messages look in bytes.

#include <memory>

#include "runtime/ports/message_codec.hpp"

namespace stillmap {

/// Encodes and decodes the types of drivers/lcm/types.  @thread boot; the codec: any
std::unique_ptr<MessageCodec> make_lcm_codec();

}  // namespace stillmap
