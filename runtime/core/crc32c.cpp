#include "runtime/core/crc32c.hpp"

#include <array>
#include <bit>
#include <cstring>

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little, "eight bytes are taken at once");

/// tables[n][b]: what byte b does to the remainder when n bytes follow it.
using Tables = std::array<std::array<uint32_t, 256>, 8>;

constexpr Tables make_tables() {
  constexpr uint32_t kPolynomial = 0x82f63b78u;  // 0x1edc6f41, lowest bit first
  Tables tables{};
  for (uint32_t b = 0; b < 256; ++b) {
    uint32_t rest = b;
    for (int bit = 0; bit < 8; ++bit) rest = rest >> 1 ^ ((rest & 1u) != 0 ? kPolynomial : 0u);
    tables[0][b] = rest;
  }
  for (size_t n = 1; n < 8; ++n)
    for (size_t b = 0; b < 256; ++b)
      tables[n][b] = tables[n - 1][b] >> 8 ^ tables[0][tables[n - 1][b] & 255u];
  return tables;
}

constexpr Tables kTables = make_tables();

}  // namespace

uint32_t crc32c(const void* bytes, size_t count, uint32_t before) {
  const auto* from = static_cast<const uint8_t*>(bytes);
  uint32_t rest = ~before;
  for (; count >= 8; count -= 8, from += 8) {
    uint64_t word = 0;
    std::memcpy(&word, from, 8);
    word ^= rest;
    rest = 0;
    for (size_t i = 0; i < 8; ++i) rest ^= kTables[7 - i][word >> (8 * i) & 255u];
  }
  for (; count > 0; --count, ++from) rest = rest >> 8 ^ kTables[0][(rest ^ *from) & 255u];
  return ~rest;
}

}  // namespace stillmap
