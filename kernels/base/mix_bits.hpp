#pragma once

#include <cstdint>

#include "kernels/base/hd.hpp"

namespace stillmap {

/// Well-mixed bits of `x`, for draws that depend on nothing but where and when; a bijection that keeps 0.
/// @thread any (pure)                                                    test: mix_bits_test
STILLMAP_HD uint32_t mix_bits(uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

}  // namespace stillmap
