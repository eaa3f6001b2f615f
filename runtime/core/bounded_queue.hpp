#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <vector>

#include "runtime/core/semaphore.hpp"

namespace stillmap {

/// Queue of fixed length between two threads. The memory is taken when it is made.
/// (readerwriterqueue orders its memory by fences, which the thread sanitizer does not follow.)
template <class T>
class BoundedQueue {
 public:
  /// @param capacity 1 or more.  @thread boot
  explicit BoundedQueue(uint32_t capacity) : items_(capacity) {}

  /// @return false: full, nothing was added.  @thread one; neither waits nor allocates
  bool push(const T& item) {
    const uint64_t last = last_.load(std::memory_order_relaxed);
    if (last - first_.load(std::memory_order_acquire) == items_.size()) return false;
    items_[last % items_.size()] = item;
    last_.store(last + 1, std::memory_order_release);
    filled_.release();
    return true;
  }
  /// Ends the wait of `pop_within`, empty-handed where there is nothing.  @thread any; neither waits nor
  /// allocates
  void wake() { filled_.release(); }
  /// @return false: empty.  @thread one, may be another than that of `push`; does not wait
  bool pop(T& item) { return filled_.try_acquire() && take(item); }
  /// @return false: nothing came within the time.  @thread as `pop`
  bool pop_within(T& item, std::chrono::milliseconds time) {
    return filled_.try_acquire_for(time) && take(item);
  }

 private:
  bool take(T& item) {
    const uint64_t first = first_.load(std::memory_order_relaxed);
    if (first == last_.load(std::memory_order_acquire)) return false;
    item = items_[first % items_.size()];
    first_.store(first + 1, std::memory_order_release);
    return true;
  }

  std::vector<T> items_;
  alignas(64) std::atomic<uint64_t> first_{0};
  alignas(64) std::atomic<uint64_t> last_{0};
  Semaphore filled_;
};

}  // namespace stillmap
