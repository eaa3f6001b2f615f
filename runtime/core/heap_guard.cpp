#include "runtime/core/heap_guard.hpp"

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define STILLMAP_HEAP_GUARD 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define STILLMAP_HEAP_GUARD 0
#endif
#endif
#ifndef STILLMAP_HEAP_GUARD
#define STILLMAP_HEAP_GUARD 1
#endif

#if STILLMAP_HEAP_GUARD
#include <execinfo.h>
#include <unistd.h>
#endif

namespace stillmap::heap_guard {
namespace {

std::atomic<uint64_t> g_allocations{0};
std::atomic<bool> g_fatal{false};
thread_local uint32_t t_armed = 0;

#if STILLMAP_HEAP_GUARD
constexpr int kMostFrames = 64;

/// Without the heap: backtrace was called once before, so that its library is loaded.
[[noreturn]] void print_stack_and_end() {
  t_armed = 0;
  static constexpr char kText[] = "stillmap: a real-time thread used the heap, from\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, kText, sizeof(kText) - 1);
  void* frames[kMostFrames];
  backtrace_symbols_fd(frames, backtrace(frames, kMostFrames), STDERR_FILENO);
  std::abort();
}

void note() {
  if (t_armed == 0) return;
  g_allocations.fetch_add(1, std::memory_order_relaxed);
  if (g_fatal.load(std::memory_order_relaxed)) print_stack_and_end();
}

[[maybe_unused]] const bool g_asked_to_be_fatal = [] {
  const char* const value = std::getenv("STILLMAP_HEAP_FATAL");
  if (value != nullptr && std::strcmp(value, "1") == 0) make_fatal();
  return true;
}();
#endif

}  // namespace

void arm_this_thread() {
  ++t_armed;
}
void disarm_this_thread() {
  --t_armed;
}
void arm_worker(bool starts) {
  starts ? arm_this_thread() : disarm_this_thread();
}
uint64_t allocations() {
  return g_allocations.load(std::memory_order_relaxed);
}
void make_fatal() {
#if STILLMAP_HEAP_GUARD
  void* frame[1];
  backtrace(frame, 1);
#endif
  g_fatal.store(true, std::memory_order_relaxed);
}
bool counts() {
  return STILLMAP_HEAP_GUARD != 0;
}

}  // namespace stillmap::heap_guard

#if STILLMAP_HEAP_GUARD

// operator new and delete of the standard library end here as well.
extern "C" {

void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);

void* malloc(size_t bytes) noexcept {
  stillmap::heap_guard::note();
  return __libc_malloc(bytes);
}
void* calloc(size_t count, size_t bytes) noexcept {
  stillmap::heap_guard::note();
  return __libc_calloc(count, bytes);
}
void* realloc(void* memory, size_t bytes) noexcept {
  stillmap::heap_guard::note();
  return __libc_realloc(memory, bytes);
}
void* aligned_alloc(size_t alignment, size_t bytes) noexcept {
  stillmap::heap_guard::note();
  return __libc_memalign(alignment, bytes);
}
void* memalign(size_t alignment, size_t bytes) noexcept {
  stillmap::heap_guard::note();
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** memory, size_t alignment, size_t bytes) noexcept {
  stillmap::heap_guard::note();
  *memory = __libc_memalign(alignment, bytes);
  return *memory == nullptr ? ENOMEM : 0;
}
void free(void* memory) noexcept {
  if (memory == nullptr) return;
  stillmap::heap_guard::note();
  __libc_free(memory);
}
}

#endif
