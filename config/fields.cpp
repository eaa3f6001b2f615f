#include "config/fields.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <sstream>

namespace stillmap {
namespace {

template <class T>
std::string shortest(T value) {
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

}  // namespace

std::vector<std::string> switch_names(const Field& field) {
  std::vector<std::string> names;
  std::istringstream in(field.unit);
  for (std::string name; std::getline(in, name, '|');) names.push_back(name);
  return names;
}

std::string float_text(float value) {
  std::string text = shortest(value);
  if (std::isfinite(value) && text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string bound_text(double value) {
  constexpr double kLongestInteger = 1e9;
  if (value == std::floor(value) && std::abs(value) <= kLongestInteger)
    return std::to_string(static_cast<int64_t>(value));
  return shortest(value);
}

std::string value_text(const Field& /*field*/, float value) {
  return float_text(value);
}
std::string value_text(const Field& /*field*/, int32_t value) {
  return std::to_string(value);
}
std::string value_text(const Field& /*field*/, const std::string& value) {
  return value;
}
std::string value_text(const Field& /*field*/, bool value) {
  return value ? "true" : "false";
}

size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

std::string nearest(std::string_view word, const std::vector<std::string>& candidates) {
  constexpr size_t kLongestWord = 64;  // outside input: the comparison takes the square of the length
  word = word.substr(0, kLongestWord);
  const auto closer = [&](const std::string& a, const std::string& b) {
    return edit_distance(word, a) < edit_distance(word, b);
  };
  const auto best = std::min_element(candidates.begin(), candidates.end(), closer);
  return best == candidates.end() ? std::string() : *best;
}

}  // namespace stillmap
