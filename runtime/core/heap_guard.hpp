#pragma once

#include <cstdint>

namespace stillmap::heap_guard {

// A program that links this file has its global operator new replaced by one that counts while the guard is
// armed, whichever thread calls. It proves that the real-time loop and the workers of the engine do not
// allocate.

/// Starts counting. @thread any
void arm();
/// Stops counting. @thread any
void disarm();
/// Allocations seen while armed, since the program started. @thread any
uint64_t allocations();
/// Counts one allocation when armed; for hooks of other allocators (tests hook malloc). @thread any
void note();
/// From now on the calling thread may allocate: it is none that real time waits for, or that it runs on.
void exempt_this_thread();
/// False under AddressSanitizer and ThreadSanitizer, whose own operator new stays in place: nothing is
/// counted there.
bool counts();

/// Armed for a scope.
class Scope {
 public:
  Scope() { arm(); }
  ~Scope() { disarm(); }
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;
};

}  // namespace stillmap::heap_guard
