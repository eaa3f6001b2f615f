#pragma once

// The LCM face of the program: what it says and hears on the network, and how its messages look in bytes.
//
// LCM's transport for messages that fit one datagram is spoken here, without LCM's library: its publish waits
// when the network does not take the datagram (5 s were seen), it opens nothing while there is no route, and
// a datagram of a stranger makes it allocate up to 256 MB. Tests talk to the library both ways.

#include <functional>
#include <memory>
#include <string>

#include "config/result.hpp"
#include "runtime/ports/message_bus.hpp"
#include "runtime/ports/message_codec.hpp"
#include "runtime/ports/odometry.hpp"

namespace stillmap {

/// This host only.
inline constexpr char kLcmDefaultUrl[] = "udpm://239.255.76.67:7667?ttl=0";

/// Encodes and decodes the types of drivers/lcm/types.  @thread boot; the codec: any
std::unique_ptr<MessageCodec> make_lcm_codec();

/// Publishes to `url`, udpm://GROUP:PORT[?ttl=N]. Without a route to the group it opens all the same; every
/// publish tries anew, with ttl 0 from a second after there is a route.
/// @return kind bad_usage: the URL is none of these; failed: the system gives no socket.  @thread boot
Result<std::unique_ptr<MessageBus>> open_lcm_bus(const std::string& url);

/// Listens for STILLMAP_COMMAND on a thread of its own. While the network is not there it tries again, once a
/// second. Of more than 16 commands that wait, the newest are refused.
/// @return errors as open_lcm_bus.  @thread boot
Result<std::unique_ptr<CommandPort>> open_lcm_commands(const std::string& url);

/// Listens for ODOMETRY (bot_core.pose_t) on a thread of its own, as open_lcm_commands; `at` is lock-free.
/// `refused` counts messages that are no poses of a body, or came while 256 others waited. A step of the
/// stamps of more than a second, either way, is a new beginning: older samples are forgotten.
/// @param clock the stamp, on the clock that `at` is asked with, of a time in UTC; called on the listening
///              thread, and must not throw
/// @thread boot
Result<std::unique_ptr<OdometryPort>> open_lcm_odometry(const std::string& url,
                                                        std::function<Stamp(Utime)> clock);

}  // namespace stillmap
