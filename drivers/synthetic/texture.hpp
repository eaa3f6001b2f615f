#pragma once

// Procedural surface colours: pure functions of surface coordinates in metres.

#include <array>
#include <cmath>
#include <cstdint>

#include "drivers/synthetic/random.hpp"
#include "drivers/synthetic/scene.hpp"

namespace stillmap::synthetic {

/// Value noise on a lattice of random numbers that repeats every 128 cells.
class ValueNoise {
 public:
  ValueNoise() {
    for (uint32_t i = 0; i < kSize * kSize; ++i)
      lattice_[i] = static_cast<float>(mix_bits(i + 77u) & 0xffffu) / 65535.0f;
  }

  /// Smooth, 0..1, features of size 1.
  float operator()(float s, float t) const {
    const float fs = std::floor(s), ft = std::floor(t);
    const uint32_t i = wrap(fs), j = wrap(ft);
    const float a = ease(s - fs), b = ease(t - ft);
    const float low = at(i, j) + a * (at(i + 1, j) - at(i, j));
    const float high = at(i, j + 1) + a * (at(i + 1, j + 1) - at(i, j + 1));
    return low + b * (high - low);
  }

 private:
  static constexpr uint32_t kSize = 128;

  static uint32_t wrap(float cell) { return static_cast<uint32_t>(static_cast<int32_t>(cell)); }
  static float ease(float x) { return x * x * (3.0f - 2.0f * x); }
  float at(uint32_t i, uint32_t j) const { return lattice_[(j % kSize) * kSize + i % kSize]; }

  std::array<float, kSize * kSize> lattice_;
};

/// -1..1, alternates every 0.5 of `x`; edges `blur` wide so that far patterns do not flicker.
inline float soft_square(float x, float blur) {
  const float saw = x - std::floor(x);                  // 0..1
  const float distance = 0.25f - std::abs(saw - 0.5f);  // sign changes every half period
  const float edge = distance / (0.5f * blur + 1e-3f);
  return edge > 1.0f ? 1.0f : edge < -1.0f ? -1.0f : edge;
}

inline Vec3 blend(Vec3 a, Vec3 b, float share_of_b) {
  return a + share_of_b * (b - a);
}

/// Random colour of a cell, neither black nor glaring.
inline Vec3 cell_colour(uint32_t h) {
  const auto channel = [&](uint32_t shift) { return static_cast<float>((h >> shift) & 0xffu); };
  const float grey = 0.4f * channel(4) + 25.0f;
  return {grey + 0.45f * channel(0), grey + 0.45f * channel(8), grey + 0.45f * channel(16)};
}

/// A print: coloured tiles of two sizes, soft shading, a light frame line here and there.
inline Vec3 poster_colour(const Material& m, const ValueNoise& noise, float s, float t) {
  const float u = s / m.scale_m, v = t / m.scale_m;
  const auto i = static_cast<uint32_t>(static_cast<int32_t>(std::floor(u)));
  const auto j = static_cast<uint32_t>(static_cast<int32_t>(std::floor(v)));
  const uint32_t h = mix_bits(i * 0x9e3779b9u ^ mix_bits(j + 131u * m.variant));
  const Vec3 tile = blend(m.colour_a, cell_colour(h), 0.8f);
  const float du = u - std::floor(u) - 0.5f, dv = v - std::floor(v) - 0.5f;
  const bool disc = (h >> 28) > 7u && du * du + dv * dv < 0.11f;
  const float shade = 0.75f + 0.5f * noise(3.0f * u, 3.0f * v);
  return shade * (disc ? blend(tile, m.colour_b, 0.7f) : tile);
}

/// Colour at the surface coordinates (s, t), metres, before lighting; sRGB, about 0..255.
/// @param footprint_m size of a pixel on the surface
inline Vec3 surface_colour(const Material& m, const ValueNoise& noise, float s, float t, float footprint_m) {
  const float u = s / m.scale_m, v = t / m.scale_m;
  const float blur = footprint_m / m.scale_m;
  const float shift = 17.0f * static_cast<float>(m.variant);
  switch (m.pattern) {
    case Pattern::plain:
      return m.colour_a;
    case Pattern::paint:
      return blend(m.colour_a, m.colour_b, noise(u + shift, v));
    case Pattern::cloud:
      return blend(m.colour_a, m.colour_b,
                   0.65f * noise(u + shift, v) + 0.35f * noise(3.1f * u, 3.1f * v + shift));
    case Pattern::stripes:
      return blend(m.colour_a, m.colour_b,
                   0.5f + 0.42f * soft_square(v, blur) + 0.16f * (noise(2.0f * u + shift, 2.0f * v) - 0.5f));
    case Pattern::checks:
      return blend(m.colour_a, m.colour_b,
                   0.5f + 0.4f * soft_square(u, blur) * soft_square(v, blur) +
                       0.2f * (noise(1.7f * u + shift, 1.7f * v) - 0.5f));
    case Pattern::planks: {
      const float board = std::floor(v);
      const float seam = soft_square(v - 0.23f, blur) < -0.9f ? 0.0f : 0.15f;
      const float grain = noise(0.6f * u + 31.7f * board, 9.0f * v);
      const float tone = noise(31.3f * board + 0.1f * u, board);
      return blend(m.colour_a, m.colour_b, 0.45f * grain + 0.4f * tone + seam);
    }
    case Pattern::wallpaper: {
      const float fine = noise(2.3f * u + shift, 2.3f * v);
      const float coarse = noise(0.31f * u, 0.31f * v + shift);
      return blend(
          m.colour_a, m.colour_b,
          0.3f * coarse + 0.3f * fine + 0.4f * (0.5f + 0.5f * soft_square(u + 0.6f * coarse, blur)) * fine);
    }
    case Pattern::poster:
      return poster_colour(m, noise, s, t);
    case Pattern::spines: {
      const auto i = static_cast<uint32_t>(static_cast<int32_t>(std::floor(u)));
      const Vec3 spine = blend(m.colour_a, cell_colour(mix_bits(i + 97u * m.variant)), 0.7f);
      const bool label = soft_square(1.5f * t / 0.3f + 0.1f * static_cast<float>(i % 3u), 0.05f) > 0.6f;
      const float gap = soft_square(2.0f * u + 0.25f, blur) < -0.98f ? 0.8f : 1.0f;
      return (gap * (0.9f + 0.2f * noise(5.0f * u, 5.0f * v))) *
             (label ? blend(spine, m.colour_b, 0.5f) : spine);
    }
  }
  return m.colour_a;
}

}  // namespace stillmap::synthetic
