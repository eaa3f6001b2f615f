#pragma once

// Walks over every setting of a Config: the one loop behind loading, checking and describing.

#include <array>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "config/config.hpp"

namespace stillmap {

/// What the `fields` lists say about a setting.
struct Field {
  const char* section;
  const char* key;
  double lowest, highest;  ///< allowed range, both ends included; of a text: its length
  const char* unit;        ///< for a switch with names: the names, separated by '|'
  const char* paper;       ///< section, equation or table of the paper, or "ours"
  const char* text;

  std::string name() const { return std::string(section) + "." + key; }
};

/// Calls `f(const Field&, value&)` for each setting of `config` in the order of the files.
/// `value` is float, int32_t, bool, text, a list of floats or one of the enums with names.
template <class ConfigT, class F>
void for_each_field(ConfigT& config, F&& f) {
  Config::sections([&](const char* section, auto section_member) {
    auto& values = config.*section_member;
    using Section = std::remove_cvref_t<decltype(values)>;
    Section::fields([&](const char* key, auto member, double lowest, double highest, const char* unit,
                        const char* paper, const char* text) {
      f(Field{section, key, lowest, highest, unit, paper, text}, values.*member);
    });
  });
}

/// The names of a switch, in the order of its values.
std::vector<std::string> switch_names(const Field& field);

/// The shortest text that reads back as the same float; always with '.' or 'e'.
std::string float_text(float value);
/// A bound of a range, the shortest text.
std::string bound_text(double value);

std::string value_text(const Field& field, float value);
std::string value_text(const Field& field, int32_t value);
std::string value_text(const Field& field, bool value);
std::string value_text(const Field& field, const std::string& value);
/// "[1.0, 2.0]"
template <size_t N>
std::string value_text(const Field& field, const std::array<float, N>& values) {
  std::string text = "[";
  for (const float value : values) text += (text.size() > 1 ? ", " : "") + value_text(field, value);
  return text + "]";
}
/// The name of a switch's value; its number when it has none.
template <class Enum>
requires std::is_enum_v<Enum> std::string value_text(const Field& field, Enum value) {
  const std::vector<std::string> names = switch_names(field);
  const auto index = static_cast<size_t>(value);
  return index < names.size() ? names[index] : std::to_string(index);
}

/// The candidate that needs the fewest typed corrections to become `word`; empty without candidates.
std::string nearest(std::string_view word, const std::vector<std::string>& candidates);
/// How many letters must be put in, taken out or replaced to turn `a` into `b`.
size_t edit_distance(std::string_view a, std::string_view b);

}  // namespace stillmap
