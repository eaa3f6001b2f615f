#pragma once

#include <cstdint>

namespace stillmap::heap_guard {

// A program that links this file has the allocator of the C library replaced by one that looks, before it
// does what it always did, whether the calling thread is armed. C++ and every library go through it. It
// proves that the real-time threads and the workers of the engine leave the heap alone.

/// From now on what the calling thread does with the heap is counted. May be nested.
void arm_this_thread();
void disarm_this_thread();
/// For the workers of an engine: armed while they live (EngineParams::on_worker).
void arm_worker(bool starts);
/// Heap calls of armed threads since the program started, `free` included. @thread any
uint64_t allocations();
/// From now on the first heap call of an armed thread prints where it came from and ends the program. The
/// variable STILLMAP_HEAP_FATAL=1 does the same. @thread boot
void make_fatal();
/// False under AddressSanitizer and ThreadSanitizer, whose own allocator stays in place, and without glibc:
/// nothing is counted there.
bool counts();

/// The calling thread, armed for a scope.
class Scope {
 public:
  Scope() { arm_this_thread(); }
  ~Scope() { disarm_this_thread(); }
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;
};

}  // namespace stillmap::heap_guard
