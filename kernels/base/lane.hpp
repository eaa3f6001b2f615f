#pragma once

// Element functions that are hot on the CPU are written over a number type F: `float` (one pixel or voxel:
// the plain form, and the GPU's) or several lanes side by side (backend/cpu/lanes.hpp). This is what both
// number types offer.

#include <cstdint>

#include "kernels/base/hd.hpp"

namespace stillmap {

/// The integer and the truth value that go with a number type.
template <class F>
struct LaneTypes;
template <>
struct LaneTypes<float> {
  using Int = int32_t;
  using Mask = bool;
};
template <class F>
using IntOf = typename LaneTypes<F>::Int;
template <class F>
using MaskOf = typename LaneTypes<F>::Mask;

STILLMAP_HD float select(bool which, float yes, float no) {
  return which ? yes : no;
}
STILLMAP_HD int32_t select(bool which, int32_t yes, int32_t no) {
  return which ? yes : no;
}
STILLMAP_HD float to_float(int32_t x) {
  return static_cast<float>(x);
}
/// Towards zero; `x` must fit.
STILLMAP_HD int32_t to_int(float x) {
  return static_cast<int32_t>(x);
}
STILLMAP_HD int32_t shift_right(int32_t x, int32_t bits) {
  return x >> bits;
}
/// Modulo 2^32, as hashes need it.
STILLMAP_HD int32_t wrapping_add(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) + static_cast<uint32_t>(b));
}
STILLMAP_HD int32_t wrapping_multiply(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) * static_cast<uint32_t>(b));
}
STILLMAP_HD float gather_float(const float* base, int32_t index) {
  return base[index];
}

/// Largest integer not above `x`; `x` must fit.
template <class F>
STILLMAP_HD IntOf<F> floor_int(F x) {
  const IntOf<F> i = to_int(x);
  return select(to_float(i) > x, i - IntOf<F>(1), i);
}
/// Nearest integer as a number, ties to even; |x| < 2^22.
template <class F>
STILLMAP_HD F round_nearest(F x) {
  const F magic = F(12582912.0f);  // 1.5 * 2^23: no room is left for a fraction
  return (x + magic) - magic;
}
template <class F>
STILLMAP_HD F abs_of(F x) {
  return select(x < F(0.0f), F(0.0f) - x, x);
}
template <class F>
STILLMAP_HD F min_of(F a, F b) {
  return select(a < b, a, b);
}
template <class F>
STILLMAP_HD F max_of(F a, F b) {
  return select(a > b, a, b);
}

}  // namespace stillmap
