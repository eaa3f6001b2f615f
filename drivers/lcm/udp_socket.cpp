#include "drivers/lcm/udp_socket.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>

namespace stillmap {

bool join_group(const UdpSocket& socket, uint32_t group) {
  ip_mreqn request{};
  request.imr_multiaddr.s_addr = htonl(group);
  return setsockopt(socket.descriptor(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request) == 0 ||
         errno == EADDRINUSE;  // it is one already
}

}  // namespace stillmap
