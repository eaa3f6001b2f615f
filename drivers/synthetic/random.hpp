#pragma once

// Randomness as a function of where and when, so that the same seed gives the same bytes with any number of
// threads.

#include <cstdint>

#include "kernels/base/mix_bits.hpp"

namespace stillmap::synthetic {

/// Key of one random field of one frame.
inline uint32_t field_key(uint64_t seed, uint32_t frame, uint32_t field) {
  const uint32_t low = mix_bits(static_cast<uint32_t>(seed) + 0x9e3779b9u * field);
  const uint32_t high = mix_bits(static_cast<uint32_t>(seed >> 32) ^ low);
  return mix_bits(frame * 0x85ebca6bu + high);
}

/// 32 random bits for a pixel.
inline uint32_t pixel_bits(uint32_t key, int32_t row, int32_t col) {
  return mix_bits(key + static_cast<uint32_t>(row) * 0x01000193u + static_cast<uint32_t>(col) * 0x9e3779b1u);
}

/// 0 <= value < 1.
inline float unit(uint32_t bits) {
  return static_cast<float>(bits >> 8) * (1.0f / 16777216.0f);
}

}  // namespace stillmap::synthetic
