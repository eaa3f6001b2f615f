#include "runtime/core/number_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

namespace stillmap {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// A decimal number taken apart: 0.DIGITS * 10^point.
struct Decimal {
  bool negative = false;
  std::string digits;  ///< without leading zeros
  int64_t point = 0;
};

/// Power of ten after an `e`; saturates far outside of any use.
std::optional<int64_t> parse_exponent(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  int64_t exponent = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), exponent);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return std::clamp<int64_t>(exponent, -10000, 10000);
}

std::optional<Decimal> parse_decimal(std::string_view text) {
  Decimal d;
  if (!text.empty() && (text.front() == '-' || text.front() == '+')) {
    d.negative = text.front() == '-';
    text.remove_prefix(1);
  }
  bool any_digit = false, after_point = false;
  std::size_t i = 0;
  for (; i < text.size() && (is_digit(text[i]) || (text[i] == '.' && !after_point)); ++i) {
    if (text[i] == '.') {
      after_point = true;
      continue;
    }
    any_digit = true;
    const bool significant = text[i] != '0' || !d.digits.empty();
    if (significant) d.digits.push_back(text[i]);
    if (!after_point && significant) ++d.point;
    if (after_point && !significant) --d.point;
  }
  if (!any_digit) return std::nullopt;
  if (i == text.size()) return d;
  if (text[i] != 'e' && text[i] != 'E') return std::nullopt;
  const std::optional<int64_t> exponent = parse_exponent(text.substr(i + 1));
  if (!exponent) return std::nullopt;
  d.point += *exponent;
  return d;
}

}  // namespace

std::optional<Stamp> parse_stamp(std::string_view text) {
  const std::optional<Decimal> decimal = parse_decimal(text);
  if (!decimal) return std::nullopt;
  if (decimal->digits.empty()) return Stamp{0};
  const int64_t digits_ns = decimal->point + 9;  // digits before the point of the number in nanoseconds
  if (digits_ns > 19) return std::nullopt;
  if (digits_ns < 0) return Stamp{0};
  std::string whole = decimal->digits.substr(0, static_cast<std::size_t>(digits_ns));
  whole.resize(static_cast<std::size_t>(digits_ns), '0');
  uint64_t ns = 0;
  for (const char c : whole) ns = ns * 10 + static_cast<uint64_t>(c - '0');
  const std::size_t next = static_cast<std::size_t>(digits_ns);
  if (next < decimal->digits.size() && decimal->digits[next] >= '5') ++ns;
  constexpr uint64_t kLimit_ns = uint64_t{100} * 366 * 24 * 3600 * 1'000'000'000;  // sums of two still fit
  if (ns > kLimit_ns) return std::nullopt;
  const int64_t magnitude = static_cast<int64_t>(ns);
  return Stamp{decimal->negative ? -magnitude : magnitude};
}

std::optional<double> parse_number(std::string_view text) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace stillmap
