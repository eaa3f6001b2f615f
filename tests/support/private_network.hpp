#pragma once

// A network of the test's own: nothing leaves it, nothing comes in, and its routes may go and come.

#include <net/if.h>
#include <net/route.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>

namespace stillmap {

class PrivateNetwork {
 public:
  /// The calling thread, and those that it starts, leave the host's network for good. Only the loopback
  /// device is there, and it is up, without a route for multicast.
  /// @return false: not permitted here
  static bool enter() {
    if (unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
    ifreq request{};
    std::strcpy(request.ifr_name, "lo");
    request.ifr_flags = IFF_UP | IFF_RUNNING | IFF_LOOPBACK | IFF_MULTICAST;
    return call(SIOCSIFFLAGS, &request);
  }
  static bool add_multicast_route() { return call(SIOCADDRT, multicast_route()); }
  static bool remove_multicast_route() { return call(SIOCDELRT, multicast_route()); }

 private:
  /// 224.0.0.0/4 by the loopback device
  static rtentry* multicast_route() {
    static rtentry route;
    static char device[] = "lo";
    const auto address = [](uint32_t host_order) {
      sockaddr_in in{};
      in.sin_family = AF_INET;
      in.sin_addr.s_addr = htonl(host_order);
      sockaddr plain;
      std::memcpy(&plain, &in, sizeof plain);
      return plain;
    };
    route = {};
    route.rt_dst = address(0xE0000000);
    route.rt_genmask = address(0xF0000000);
    route.rt_flags = RTF_UP;
    route.rt_dev = device;
    return &route;
  }
  static bool call(unsigned long request, void* argument) {
    const int descriptor = socket(AF_INET, SOCK_DGRAM, 0);
    const bool done = ioctl(descriptor, request, argument) == 0;
    close(descriptor);
    return done;
  }
};

}  // namespace stillmap
