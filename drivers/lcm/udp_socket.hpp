#pragma once

#include <unistd.h>

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

}  // namespace stillmap
