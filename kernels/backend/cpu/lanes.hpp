#pragma once

// Eight numbers side by side, by the compiler's vector types: two SSE or NEON registers, or one AVX register.

#include <bit>
#include <cstdint>
#include <cstring>

#include "kernels/base/lane.hpp"

#if defined(__AVX2__)
#include <immintrin.h>  // for what the compiler does not find by itself: tests of a mask, gathers
#endif

namespace stillmap {

constexpr int32_t kLanes = 8;

struct Mask8 {
  using Bits = int32_t __attribute__((vector_size(32)));
  Bits bits;  ///< each lane all ones or all zeros

  STILLMAP_HD bool any() const {
#if defined(__AVX2__)
    const auto all = std::bit_cast<__m256i>(bits);
    return !_mm256_testz_si256(all, all);
#else
    int32_t all = 0;
    for (int32_t i = 0; i < kLanes; ++i) all |= bits[i];
    return all != 0;
#endif
  }
  /// One bit a lane, lane 0 lowest.
  STILLMAP_HD uint32_t lanes() const {
#if defined(__AVX2__)
    return static_cast<uint32_t>(_mm256_movemask_ps(std::bit_cast<__m256>(bits)));
#else
    uint32_t all = 0;
    for (int32_t i = 0; i < kLanes; ++i) all |= (static_cast<uint32_t>(bits[i]) & 1u) << i;
    return all;
#endif
  }
};
STILLMAP_HD Mask8 operator&(Mask8 a, Mask8 b) {
  return {a.bits & b.bits};
}
STILLMAP_HD Mask8 operator|(Mask8 a, Mask8 b) {
  return {a.bits | b.bits};
}
STILLMAP_HD Mask8 operator!(Mask8 a) {
  return {~a.bits};
}

struct Int8 {
  using Bits = Mask8::Bits;
  using Unsigned = uint32_t __attribute__((vector_size(32)));
  Bits v;

  Int8() = default;
  STILLMAP_HD Int8(int32_t x) : v(Bits{x, x, x, x, x, x, x, x}) {}  // NOLINT(google-explicit-constructor)
  STILLMAP_HD explicit Int8(Bits x) : v(x) {}
  STILLMAP_HD int32_t operator[](int32_t lane) const { return v[lane]; }

  STILLMAP_HD static Int8 load(const void* from) {
    Int8 x;
    std::memcpy(&x.v, from, sizeof(x.v));
    return x;
  }
  STILLMAP_HD void store(void* to) const { std::memcpy(to, &v, sizeof(v)); }
};
STILLMAP_HD Int8 operator+(Int8 a, Int8 b) {
  return Int8(a.v + b.v);
}
STILLMAP_HD Int8 operator-(Int8 a, Int8 b) {
  return Int8(a.v - b.v);
}
STILLMAP_HD Int8 operator*(Int8 a, Int8 b) {
  return Int8(a.v * b.v);
}
STILLMAP_HD Int8 operator&(Int8 a, Int8 b) {
  return Int8(a.v & b.v);
}
STILLMAP_HD Int8 operator|(Int8 a, Int8 b) {
  return Int8(a.v | b.v);
}
STILLMAP_HD Int8 operator^(Int8 a, Int8 b) {
  return Int8(a.v ^ b.v);
}
STILLMAP_HD Int8 operator<<(Int8 a, int32_t bits) {
  return Int8(a.v << bits);
}
STILLMAP_HD Int8 shift_right(Int8 a, int32_t bits) {
  return Int8(a.v >> bits);
}
STILLMAP_HD Int8 wrapping_add(Int8 a, Int8 b) {
  return Int8(
      std::bit_cast<Int8::Bits>(std::bit_cast<Int8::Unsigned>(a.v) + std::bit_cast<Int8::Unsigned>(b.v)));
}
STILLMAP_HD Int8 wrapping_multiply(Int8 a, Int8 b) {
  return Int8(
      std::bit_cast<Int8::Bits>(std::bit_cast<Int8::Unsigned>(a.v) * std::bit_cast<Int8::Unsigned>(b.v)));
}
STILLMAP_HD Mask8 operator==(Int8 a, Int8 b) {
  return {a.v == b.v};
}
STILLMAP_HD Mask8 operator!=(Int8 a, Int8 b) {
  return {a.v != b.v};
}
STILLMAP_HD Mask8 operator<(Int8 a, Int8 b) {
  return {a.v < b.v};
}
STILLMAP_HD Mask8 operator>(Int8 a, Int8 b) {
  return {a.v > b.v};
}

struct Float8 {
  using Bits = float __attribute__((vector_size(32)));
  Bits v;

  Float8() = default;
  STILLMAP_HD Float8(float x) : v(Bits{x, x, x, x, x, x, x, x}) {}  // NOLINT(google-explicit-constructor)
  STILLMAP_HD explicit Float8(Bits x) : v(x) {}
  STILLMAP_HD float operator[](int32_t lane) const { return v[lane]; }

  STILLMAP_HD static Float8 load(const float* from) {
    Float8 x;
    std::memcpy(&x.v, from, sizeof(x.v));
    return x;
  }
  STILLMAP_HD void store(float* to) const { std::memcpy(to, &v, sizeof(v)); }
  STILLMAP_HD float least() const {
    float least = v[0];
    for (int32_t i = 1; i < kLanes; ++i) least = v[i] < least ? v[i] : least;
    return least;
  }
  STILLMAP_HD float most() const {
    float most = v[0];
    for (int32_t i = 1; i < kLanes; ++i) most = v[i] > most ? v[i] : most;
    return most;
  }
  /// 0, 1, .. 7
  STILLMAP_HD static Float8 ramp() { return Float8(Bits{0, 1, 2, 3, 4, 5, 6, 7}); }
};
STILLMAP_HD Float8 operator+(Float8 a, Float8 b) {
  return Float8(a.v + b.v);
}
STILLMAP_HD Float8 operator-(Float8 a, Float8 b) {
  return Float8(a.v - b.v);
}
STILLMAP_HD Float8 operator-(Float8 a) {
  return Float8(-a.v);
}
STILLMAP_HD Float8 operator*(Float8 a, Float8 b) {
  return Float8(a.v * b.v);
}
STILLMAP_HD Float8 operator/(Float8 a, Float8 b) {
  return Float8(a.v / b.v);
}
STILLMAP_HD Float8& operator+=(Float8& a, Float8 b) {
  return a = a + b;
}
STILLMAP_HD Mask8 operator<(Float8 a, Float8 b) {
  return {a.v < b.v};
}
STILLMAP_HD Mask8 operator>(Float8 a, Float8 b) {
  return {a.v > b.v};
}
STILLMAP_HD Mask8 operator<=(Float8 a, Float8 b) {
  return {a.v <= b.v};
}
STILLMAP_HD Mask8 operator>=(Float8 a, Float8 b) {
  return {a.v >= b.v};
}

template <>
struct LaneTypes<Float8> {
  using Int = Int8;
  using Mask = Mask8;
};

STILLMAP_HD Float8 select(Mask8 which, Float8 yes, Float8 no) {
  return Float8(which.bits ? yes.v : no.v);
}
STILLMAP_HD Int8 select(Mask8 which, Int8 yes, Int8 no) {
  return Int8(which.bits ? yes.v : no.v);
}
STILLMAP_HD Float8 to_float(Int8 x) {
  return Float8(__builtin_convertvector(x.v, Float8::Bits));
}
STILLMAP_HD Int8 to_int(Float8 x) {
  return Int8(__builtin_convertvector(x.v, Int8::Bits));
}

/// One element a lane, from anywhere.
STILLMAP_HD Float8 gather_float(const float* base, Int8 index) {
#if defined(__AVX2__)
  return Float8(std::bit_cast<Float8::Bits>(_mm256_i32gather_ps(base, std::bit_cast<__m256i>(index.v), 4)));
#else
  Float8 out;
  for (int32_t i = 0; i < kLanes; ++i) out.v[i] = base[index[i]];
  return out;
#endif
}
/// One 32-bit word a lane.
STILLMAP_HD Int8 gather_word(const void* base, Int8 index) {
#if defined(__AVX2__)
  return Int8(std::bit_cast<Int8::Bits>(
      _mm256_i32gather_epi32(static_cast<const int*>(base), std::bit_cast<__m256i>(index.v), 4)));
#else
  Int8 out;
  for (int32_t i = 0; i < kLanes; ++i) {
    int32_t word;
    std::memcpy(&word, static_cast<const char*>(base) + 4 * static_cast<int64_t>(index[i]), 4);
    out.v[i] = word;
  }
  return out;
#endif
}

/// Eight rows of eight 32-bit words: `column[c]` gets word c of every row. By quarters, four words at a time,
/// which every instruction set has.
STILLMAP_HD void transposed_words(const void* rows, Int8 column[8]) {
  using Four = int32_t __attribute__((vector_size(16)));
  const auto quarter = [&](int32_t row, int32_t col, Four out[4]) {
    Four in[4];
    for (int32_t i = 0; i < 4; ++i)
      std::memcpy(&in[i], static_cast<const char*>(rows) + 32 * (row + i) + 4 * col, sizeof in[i]);
    const auto low = [](Four a, Four b) { return Four{a[0], b[0], a[1], b[1]}; };
    const auto high = [](Four a, Four b) { return Four{a[2], b[2], a[3], b[3]}; };
    const Four ac0 = low(in[0], in[2]), ac1 = high(in[0], in[2]);
    const Four bd0 = low(in[1], in[3]), bd1 = high(in[1], in[3]);
    out[0] = low(ac0, bd0), out[1] = high(ac0, bd0), out[2] = low(ac1, bd1), out[3] = high(ac1, bd1);
  };
  for (const int32_t col : {0, 4}) {
    Four upper[4], lower[4];
    quarter(0, col, upper);
    quarter(4, col, lower);
    for (int32_t i = 0; i < 4; ++i) {
      std::memcpy(&column[col + i].v, &upper[i], sizeof upper[i]);
      std::memcpy(reinterpret_cast<char*>(&column[col + i].v) + sizeof upper[i], &lower[i], sizeof lower[i]);
    }
  }
}

}  // namespace stillmap
