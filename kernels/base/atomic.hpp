#pragma once

// The few atomic operations of the map, on plain integers, so that the same element functions run in both
// engines.

#include <cstdint>

#include "kernels/base/hd.hpp"

namespace stillmap {

/// Replaces `expected` by `desired`; @return what was there (`expected` when the exchange happened).
template <class T>
STILLMAP_HD T atomic_compare_exchange(T* at, T expected, T desired) {
  __atomic_compare_exchange_n(at, &expected, desired, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
  return expected;
}
/// @return the value before the addition.
template <class T>
STILLMAP_HD T atomic_add(T* at, T amount) {
  return __atomic_fetch_add(at, amount, __ATOMIC_ACQ_REL);
}
template <class T>
STILLMAP_HD T atomic_load(const T* at) {
  return __atomic_load_n(at, __ATOMIC_ACQUIRE);
}
template <class T>
STILLMAP_HD void atomic_store(T* at, T value) {
  __atomic_store_n(at, value, __ATOMIC_RELEASE);
}

}  // namespace stillmap
