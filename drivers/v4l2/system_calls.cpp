#include "drivers/v4l2/system_calls.hpp"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>

namespace stillmap {
namespace {

/// Signals do not come without end.
constexpr int kRepeats = 100;

template <class Call>
int repeated(Call call) {
  int result = -1;
  for (int i = 0; i < kRepeats; ++i)
    if (result = call(); result >= 0 || errno != EINTR) break;
  return result;
}

class KernelCalls final : public SystemCalls {
 public:
  int open(const char* path) override {
    return repeated([&] { return ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC); });
  }
  int close(int fd) override { return ::close(fd); }
  int control(int fd, unsigned long request, void* argument) override {
    return repeated([&] { return ::ioctl(fd, request, argument); });
  }
  void* map(int fd, size_t bytes, int64_t offset) override {
    void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
    return memory == MAP_FAILED ? nullptr : memory;
  }
  int unmap(void* memory, size_t bytes) override { return ::munmap(memory, bytes); }
  int poll(pollfd* fds, uint32_t count, int32_t timeout_ms) override {
    const int ready = ::poll(fds, count, timeout_ms);
    return ready < 0 && errno == EINTR ? 0 : ready;  // the caller looks at its clock and waits on
  }
};

}  // namespace

SystemCalls& kernel_calls() {
  static KernelCalls calls;
  return calls;
}

}  // namespace stillmap
