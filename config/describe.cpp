#include "config/describe.hpp"

#include <fmt/format.h>

#include "config/fields.hpp"

namespace stillmap {
namespace {

constexpr const char* kHeading =
    "# Every setting of Stillmap. Behind each: unit, allowed range, where the paper says it, what it does.\n"
    "# \"ours\" marks what the paper leaves open.\n";

template <class T>
std::string toml_value(const Field& field, const T& value) {
  const std::string text = value_text(field, value);
  return std::is_enum_v<T> || std::is_same_v<T, std::string> ? '"' + text + '"' : text;
}

/// "m, 0.01 to 10", or the names of a switch.
template <class T>
std::string domain(const Field& field) {
  if constexpr (std::is_same_v<T, bool>) {
    return "true or false";
  } else if constexpr (std::is_enum_v<T> || std::is_same_v<T, std::string>) {
    return field.unit;
  } else {
    const std::string unit = field.unit == std::string_view("1") ? "" : field.unit + std::string(", ");
    return fmt::format("{}{} to {}", unit, bound_text(field.lowest), bound_text(field.highest));
  }
}

}  // namespace

std::string to_toml(const Config& config) {
  std::string text = kHeading;
  std::string section;
  for_each_field(config, [&](const Field& field, const auto& value) {
    using T = std::remove_cvref_t<decltype(value)>;
    if (section != field.section) {
      section = field.section;
      text += fmt::format("\n[{}]\n", section);
    }
    const std::string assignment = fmt::format("{} = {}", field.key, toml_value(field, value));
    text += fmt::format("{:<30} # {}; {}; {}\n", assignment, domain<T>(field), field.paper, field.text);
  });
  return text;
}

}  // namespace stillmap
