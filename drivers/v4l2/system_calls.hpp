#pragma once

#include <poll.h>

#include <cstddef>
#include <cstdint>

namespace stillmap {

/// What a video node needs of the kernel, each as its namesake; a test puts a camera of its own in their
/// place. They fail with -1 (map: null) and errno, and go on when a signal interrupts them.
/// @thread any
class SystemCalls {
 public:
  virtual ~SystemCalls() = default;
  /// For reading and writing, never waiting, not for programs that are started.
  virtual int open(const char* path) = 0;
  virtual int close(int fd) = 0;
  virtual int control(int fd, unsigned long request, void* argument) = 0;  ///< ioctl
  virtual void* map(int fd, size_t bytes, int64_t offset) = 0;             ///< shared
  virtual int unmap(void* memory, size_t bytes) = 0;
  virtual int poll(pollfd* fds, uint32_t count, int32_t timeout_ms) = 0;
};

/// Those of this machine.
SystemCalls& kernel_calls();

}  // namespace stillmap
