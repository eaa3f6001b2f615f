#pragma once

// LCM's encoding: big-endian members in the order of the type, before them the type's fingerprint. A type is
// one list of members (codec.cpp) that Writer and Reader both go through.

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

#include "kernels/base/view.hpp"

namespace stillmap::lcm_wire {

/// `text` up to its first 0, no longer than `longest` bytes, never cut within a character of UTF-8.
inline std::string_view cut(std::string_view text, size_t longest) {
  text = text.substr(0, text.find('\0'));
  if (text.size() <= longest) return text;
  while (longest > 0 && (static_cast<unsigned char>(text[longest]) & 0xC0) == 0x80) --longest;
  return text.substr(0, longest);
}

/// Writes as long as there is room and all is well; afterwards `size()` is 0.
class Writer {
 public:
  explicit Writer(View<uint8_t> to) : to_(to) {}

  /// Only what is read may be of an older program.
  static constexpr bool older = false;

  uint32_t size() const { return fits_ ? at_ : 0; }

  template <class T>
  void number(const T& value) {
    using Bits =
        std::conditional_t<sizeof(T) == 8, uint64_t, std::conditional_t<sizeof(T) == 4, uint32_t, uint8_t>>;
    static_assert(std::is_arithmetic_v<T> && sizeof(T) == sizeof(Bits));
    if (!room_for(sizeof(T))) return;
    const Bits bits = std::bit_cast<Bits>(value);
    for (uint32_t byte = 0; byte < sizeof(T); ++byte)
      to_[at_++] = static_cast<uint8_t>(bits >> (8 * (sizeof(T) - 1 - byte)));
  }
  template <class T, size_t N>
  void numbers(const T (&values)[N]) {
    for (const T& value : values) number(value);
  }
  /// On the wire an int64_t.
  void count(uint32_t value) { number(static_cast<int64_t>(value)); }
  void boolean(bool value) { number(static_cast<uint8_t>(value)); }
  /// On the wire an int8_t.
  template <class E>
  void one_of(E value, E /*first*/, E /*last*/) {
    number(static_cast<uint8_t>(value));
  }
  void text(std::string_view value, size_t longest) {
    value = cut(value, longest);
    number(static_cast<uint32_t>(value.size() + 1));
    bytes_of({reinterpret_cast<const uint8_t*>(value.data()), static_cast<uint32_t>(value.size())});
    number(uint8_t{0});
  }
  template <size_t N>
  void text(const std::array<char, N>& value) {
    text({value.data(), N}, N - 1);
  }
  void require(bool condition) { fits_ = fits_ && condition; }
  /// An int32_t with their number, then the bytes.
  void bytes(View<const uint8_t> value) {
    number(value.size);
    bytes_of(value);
  }

 private:
  bool room_for(size_t bytes) { return fits_ = fits_ && bytes <= to_.size - at_; }
  void bytes_of(View<const uint8_t> value) {
    if (!room_for(value.size) || value.size == 0) return;
    std::memcpy(to_.data + at_, value.data, value.size);
    at_ += value.size;
  }

  View<uint8_t> to_;
  uint32_t at_ = 0;
  bool fits_ = true;
};

/// Reads as long as all is well; what it gives after that means nothing.
class Reader {
 public:
  explicit Reader(View<const uint8_t> from) : from_(from) {}

  /// The type lacks the members that came last.
  bool older = false;

  /// Every byte was read and every value is in its range.
  bool complete() const { return good_ && at_ == from_.size; }

  template <class T>
  void number(T& value) {
    using Bits =
        std::conditional_t<sizeof(T) == 8, uint64_t, std::conditional_t<sizeof(T) == 4, uint32_t, uint8_t>>;
    static_assert(std::is_arithmetic_v<T> && sizeof(T) == sizeof(Bits));
    if (!has(sizeof(T))) return;
    Bits bits = 0;
    for (size_t byte = 0; byte < sizeof(T); ++byte)
      bits = static_cast<Bits>(uint64_t{bits} << 8 | from_[at_++]);
    value = std::bit_cast<T>(bits);
  }
  template <class T, size_t N>
  void numbers(T (&values)[N]) {
    for (T& value : values) number(value);
  }
  void count(uint32_t& value) {
    int64_t wide = 0;
    number(wide);
    require(wide >= 0 && wide <= std::numeric_limits<uint32_t>::max());
    value = static_cast<uint32_t>(wide);
  }
  void boolean(bool& value) {
    uint8_t byte = 0;
    number(byte);
    require(byte <= 1);
    value = byte == 1;
  }
  template <class E>
  void one_of(E& value, E first, E last) {
    uint8_t byte = 0;
    number(byte);
    require(byte >= static_cast<uint8_t>(first) && byte <= static_cast<uint8_t>(last));
    if (good_) value = static_cast<E>(byte);
  }
  void text(std::string_view& value, size_t longest) {
    uint32_t size = 0;  // the closing 0 included
    number(size);
    require(size >= 1 && size - 1 <= longest);
    if (!has(size)) return;
    const char* begin = reinterpret_cast<const char*>(from_.data + at_);
    at_ += size;
    require(std::memchr(begin, 0, size) == begin + size - 1);
    value = {begin, size - 1};
  }
  template <size_t N>
  void text(std::array<char, N>& value) {
    std::string_view view;
    text(view, N - 1);
    if (!good_) return;
    value = {};
    view.copy(value.data(), N - 1);
  }
  void bytes(View<const uint8_t>& value) {
    uint32_t size = 0;
    number(size);
    if (!has(size)) return;
    value = {from_.data + at_, size};
    at_ += size;
  }
  void require(bool condition) { good_ = good_ && condition; }

 private:
  bool has(size_t bytes) { return good_ = good_ && bytes <= from_.size - at_; }

  View<const uint8_t> from_;
  uint32_t at_ = 0;
  bool good_ = true;
};

}  // namespace stillmap::lcm_wire
