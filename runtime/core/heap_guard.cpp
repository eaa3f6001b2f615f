#include "runtime/core/heap_guard.hpp"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define STILLMAP_HEAP_GUARD 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define STILLMAP_HEAP_GUARD 0
#endif
#endif
#ifndef STILLMAP_HEAP_GUARD
#define STILLMAP_HEAP_GUARD 1
#endif

namespace stillmap::heap_guard {
namespace {

// Relaxed is enough: arm and disarm stand around calls that synchronise with the workers by themselves.
std::atomic<bool> g_armed{false};
std::atomic<uint64_t> g_allocations{0};
thread_local bool t_exempt = false;

}  // namespace

void arm() {
  g_armed.store(true, std::memory_order_relaxed);
}
void disarm() {
  g_armed.store(false, std::memory_order_relaxed);
}
uint64_t allocations() {
  return g_allocations.load(std::memory_order_relaxed);
}
void note() {
  if (g_armed.load(std::memory_order_relaxed) && !t_exempt)
    g_allocations.fetch_add(1, std::memory_order_relaxed);
}
void exempt_this_thread() {
  t_exempt = true;
}
bool counts() {
  return STILLMAP_HEAP_GUARD != 0;
}

}  // namespace stillmap::heap_guard

#if STILLMAP_HEAP_GUARD

namespace {

void* allocate(std::size_t bytes) {
  stillmap::heap_guard::note();
  return std::malloc(bytes == 0 ? 1 : bytes);
}

void* allocate_aligned(std::size_t bytes, std::align_val_t alignment) {
  stillmap::heap_guard::note();
  const auto a = static_cast<std::size_t>(alignment);
  return std::aligned_alloc(a, (bytes + a - 1) / a * a);  // the size must be a multiple of the alignment
}

void* or_throw(void* memory) {
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

// All forms that the standard names end in malloc and free, so that any pair of them fits together.
void* operator new(std::size_t n) {
  return or_throw(allocate(n));
}
void* operator new[](std::size_t n) {
  return or_throw(allocate(n));
}
void* operator new(std::size_t n, const std::nothrow_t&) noexcept {
  return allocate(n);
}
void* operator new[](std::size_t n, const std::nothrow_t&) noexcept {
  return allocate(n);
}
void* operator new(std::size_t n, std::align_val_t a) {
  return or_throw(allocate_aligned(n, a));
}
void* operator new[](std::size_t n, std::align_val_t a) {
  return or_throw(allocate_aligned(n, a));
}
void* operator new(std::size_t n, std::align_val_t a, const std::nothrow_t&) noexcept {
  return allocate_aligned(n, a);
}
void* operator new[](std::size_t n, std::align_val_t a, const std::nothrow_t&) noexcept {
  return allocate_aligned(n, a);
}
void operator delete(void* p) noexcept {
  std::free(p);
}
void operator delete[](void* p) noexcept {
  std::free(p);
}
void operator delete(void* p, std::size_t) noexcept {
  std::free(p);
}
void operator delete[](void* p, std::size_t) noexcept {
  std::free(p);
}
void operator delete(void* p, const std::nothrow_t&) noexcept {
  std::free(p);
}
void operator delete[](void* p, const std::nothrow_t&) noexcept {
  std::free(p);
}
void operator delete(void* p, std::align_val_t) noexcept {
  std::free(p);
}
void operator delete[](void* p, std::align_val_t) noexcept {
  std::free(p);
}
void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  std::free(p);
}
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept {
  std::free(p);
}
void operator delete(void* p, std::align_val_t, const std::nothrow_t&) noexcept {
  std::free(p);
}
void operator delete[](void* p, std::align_val_t, const std::nothrow_t&) noexcept {
  std::free(p);
}

#endif
