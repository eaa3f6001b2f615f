#include "drivers/dataset/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "config/read_file.hpp"

namespace stillmap {
inline namespace dataset_text {
namespace {

constexpr uint64_t kMaxTextBytes = 64 << 20;
constexpr int64_t kMaxNs = int64_t{100} * 366 * 24 * 3600 * 1000000000;

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// A decimal number taken apart: 0.DIGITS times ten to the `point`.
struct Decimal {
  bool negative = false;
  std::string digits;
  int64_t point = 0;
};

bool take_exponent(std::string_view text, int64_t& exponent) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), exponent);
  constexpr int64_t kMaxExponent = 1000;
  return error == std::errc() && end == text.data() + text.size() && std::abs(exponent) <= kMaxExponent;
}

std::optional<Decimal> take_apart(std::string_view word) {
  Decimal number;
  if (word.starts_with('-') || word.starts_with('+')) {
    number.negative = word.front() == '-';
    word.remove_prefix(1);
  }
  bool behind_point = false;
  size_t i = 0;
  for (; i < word.size(); ++i) {
    if (is_digit(word[i])) {
      number.digits += word[i];
      if (!behind_point) ++number.point;
    } else if (word[i] == '.' && !behind_point) {
      behind_point = true;
    } else {
      break;
    }
  }
  if (number.digits.empty()) return std::nullopt;
  if (i == word.size()) return number;
  int64_t exponent = 0;
  if ((word[i] != 'e' && word[i] != 'E') || !take_exponent(word.substr(i + 1), exponent)) return std::nullopt;
  number.point += exponent;
  return number;
}

}  // namespace

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view kBetween = " \t\r\n,";
  std::vector<std::string_view> words;
  size_t at = line.find_first_not_of(kBetween);
  if (at == std::string_view::npos || line[at] == '#') return words;
  while (at != std::string_view::npos) {
    const size_t end = std::min(line.find_first_of(kBetween, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBetween, end);
  }
  return words;
}

std::optional<double> parse_number(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(number)) return std::nullopt;
  return number;
}

std::optional<Stamp> parse_stamp(std::string_view word) {
  const std::optional<Decimal> number = take_apart(word);
  if (!number) return std::nullopt;
  constexpr int64_t kNsDigits = 9;
  const int64_t whole_digits = number->point + kNsDigits;  // of the count of nanoseconds
  const auto digit = [&](int64_t i) {
    return i >= 0 && i < static_cast<int64_t>(number->digits.size())
               ? number->digits[static_cast<size_t>(i)] - '0'
               : 0;
  };
  int64_t ns = 0;
  for (int64_t i = 0; i < whole_digits; ++i) {
    if (ns > kMaxNs / 10) return std::nullopt;
    ns = ns * 10 + digit(i);
  }
  if (digit(whole_digits) >= 5) ++ns;
  return Stamp{number->negative ? -ns : ns};
}

std::string stamp_text(Stamp stamp) {
  return fmt::format("{:.6f}", stamp.seconds());
}

Result<TextFile> TextFile::read(const std::string& path) {
  Result<std::string> content = read_file(path, kMaxTextBytes);
  if (!content) return Error{content.error(), ErrorKind::cannot_open};
  TextFile file;
  file.path_ = path;
  file.content_ = std::move(*content);
  return file;
}

std::vector<TextLine> TextFile::lines() const {
  std::vector<TextLine> lines;
  const std::string_view all = content_;
  size_t number = 0;
  for (size_t at = 0; at < all.size();) {
    const size_t end = std::min(all.find('\n', at), all.size());
    std::vector<std::string_view> words = words_of(all.substr(at, end - at));
    ++number;
    if (!words.empty()) lines.push_back({number, std::move(words)});
    at = end + 1;
  }
  return lines;
}

}  // namespace dataset_text
}  // namespace stillmap
