#pragma once

#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <utility>

namespace stillmap {

/// Owns a socket's descriptor.
class UdpSocket {
 public:
  UdpSocket() = default;
  explicit UdpSocket(int descriptor) : descriptor_(descriptor) {}
  UdpSocket(UdpSocket&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  UdpSocket& operator=(UdpSocket&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~UdpSocket() {
    if (descriptor_ >= 0) close(descriptor_);
  }

  int descriptor() const { return descriptor_; }
  explicit operator bool() const { return descriptor_ >= 0; }

 private:
  int descriptor_ = -1;
};

/// Makes the socket a member of the group on the device that the host's routes lead to now. Networks come, go
/// and change: once every `kJoinEvery` keeps up with them, and costs nothing while all is as it was.
/// @param group IPv4, host byte order
/// @return false: no route leads there.  @thread any; may wait while the system changes its networks
bool join_group(const UdpSocket& socket, uint32_t group);
inline constexpr std::chrono::seconds kJoinEvery{1};

}  // namespace stillmap
