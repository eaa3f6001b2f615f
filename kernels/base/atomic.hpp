#pragma once

// The few atomic operations of the map, on plain integers, so that the same element functions run in both
// engines.

#include <cstdint>

#include "kernels/base/hd.hpp"

namespace stillmap {

#if STILLMAP_ON_GPU
namespace atomic_detail {
template <int kBytes>
struct Word;
template <>
struct Word<4> {
  using Type = unsigned int;
};
template <>
struct Word<8> {
  using Type = unsigned long long;  // the only 64-bit integer of CUDA's atomics
};
template <class T>
using WordOf = typename Word<sizeof(T)>::Type;
}  // namespace atomic_detail
#endif

/// Replaces `expected` by `desired`; @return what was there (`expected` when the exchange happened).
template <class T>
STILLMAP_HD T atomic_compare_exchange(T* at, T expected, T desired) {
#if STILLMAP_ON_GPU
  using W = atomic_detail::WordOf<T>;
  return static_cast<T>(
      atomicCAS(reinterpret_cast<W*>(at), static_cast<W>(expected), static_cast<W>(desired)));
#else
  __atomic_compare_exchange_n(at, &expected, desired, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
  return expected;
#endif
}
/// @return the value before the addition.
template <class T>
STILLMAP_HD T atomic_add(T* at, T amount) {
#if STILLMAP_ON_GPU
  using W = atomic_detail::WordOf<T>;
  return static_cast<T>(atomicAdd(reinterpret_cast<W*>(at), static_cast<W>(amount)));
#else
  return __atomic_fetch_add(at, amount, __ATOMIC_ACQ_REL);
#endif
}
/// On the GPU what another block wrote during the same launch may not be seen yet: who decides by the answer
/// asks again by an exchange, as HashView does.
template <class T>
STILLMAP_HD T atomic_load(const T* at) {
#if STILLMAP_ON_GPU
  return *at;
#else
  return __atomic_load_n(at, __ATOMIC_ACQUIRE);
#endif
}
template <class T>
STILLMAP_HD void atomic_store(T* at, T value) {
#if STILLMAP_ON_GPU
  __threadfence();
  *at = value;
#else
  __atomic_store_n(at, value, __ATOMIC_RELEASE);
#endif
}
/// Lowers `*at` to `value` where that is less. @return the value before.
template <class T>
STILLMAP_HD T atomic_least(T* at, T value) {
  T was = atomic_load(at);
  while (value < was) {
    const T found = atomic_compare_exchange(at, was, value);
    if (found == was) break;
    was = found;
  }
  return was;
}

}  // namespace stillmap
