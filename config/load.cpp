#include "config/load.hpp"

#include "config/toml_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include "config/fields.hpp"
#include "config/read_file.hpp"

namespace stillmap {
namespace {

using toml_text::at_line;

/// A problem with the value of a key; empty: none.
using Complaint = std::string;

Complaint store(double number, float& out) {
  if (!std::isfinite(number) || std::abs(number) > static_cast<double>(std::numeric_limits<float>::max()))
    return "expected a finite number";
  out = static_cast<float>(number);
  return {};
}

Complaint store(int64_t number, int32_t& out) {
  if (number < std::numeric_limits<int32_t>::min() || number > std::numeric_limits<int32_t>::max())
    return "expected a whole number of at most 32 bits";
  out = static_cast<int32_t>(number);
  return {};
}

template <class Enum>
Complaint store_name(const Field& field, std::string_view text, Enum& out) {
  const std::vector<std::string> names = switch_names(field);
  for (size_t i = 0; i < names.size(); ++i)
    if (names[i] == text) {
      out = static_cast<Enum>(i);
      return {};
    }
  return std::string("expected one of ") + field.unit;
}

// --- values of a TOML file
// ---------------------------------------------------------------------------------------

Complaint from_toml(const Field& /*field*/, const toml::node& node, float& out) {
  if (const auto real = node.value_exact<double>()) return store(*real, out);
  if (const auto whole = node.value_exact<int64_t>()) return store(static_cast<double>(*whole), out);
  return "expected a number";
}
Complaint from_toml(const Field& /*field*/, const toml::node& node, int32_t& out) {
  if (const auto whole = node.value_exact<int64_t>()) return store(*whole, out);
  return "expected a whole number";
}
Complaint from_toml(const Field& /*field*/, const toml::node& node, bool& out) {
  const auto value = node.value_exact<bool>();
  if (!value) return "expected true or false";
  out = *value;
  return {};
}
/// What would break a line of a file, or its quotes, is no part of a name.
Complaint store(std::string_view text, std::string& out) {
  for (const char c : text)
    if (static_cast<unsigned char>(c) < ' ' || c == '"' || c == '\\')
      return "expected a text without quotes, backslashes and control characters";
  out = text;
  return {};
}
Complaint from_toml(const Field& /*field*/, const toml::node& node, std::string& out) {
  const auto text = node.value_exact<std::string>();
  return text ? store(std::string_view(*text), out) : Complaint("expected a text in quotes");
}
template <size_t N>
Complaint from_toml(const Field& field, const toml::node& node, std::array<float, N>& out) {
  const toml::array* list = node.as_array();
  std::array<float, N> values = {};
  if (!list || list->size() != N) return "expected a list of " + std::to_string(N) + " numbers";
  for (size_t i = 0; i < N; ++i)
    if (Complaint complaint = from_toml(field, (*list)[i], values[i]); !complaint.empty()) return complaint;
  out = values;
  return {};
}
template <class Enum>
Complaint from_toml(const Field& field, const toml::node& node, Enum& out) {
  const auto text = node.value_exact<std::string>();
  return store_name(field, text ? *text : std::string(), out);
}

// --- values of the command line
// ----------------------------------------------------------------------------------

template <class Number>
bool parse_all(std::string_view text, Number& out) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc() && end == text.data() + text.size();
}

Complaint from_text(const Field& /*field*/, std::string_view text, float& out) {
  double number = 0;
  return parse_all(text, number) ? store(number, out) : Complaint("expected a number");
}
Complaint from_text(const Field& /*field*/, std::string_view text, int32_t& out) {
  int64_t number = 0;
  return parse_all(text, number) ? store(number, out) : Complaint("expected a whole number");
}
Complaint from_text(const Field& /*field*/, std::string_view text, bool& out) {
  if (text != "true" && text != "false") return "expected true or false";
  out = text == "true";
  return {};
}
Complaint from_text(const Field& /*field*/, std::string_view text, std::string& out) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return store(text, out);
}
/// "1,2,3", or as in a file: "[1, 2, 3]".
template <size_t N>
Complaint from_text(const Field& field, std::string_view text, std::array<float, N>& out) {
  if (text.size() >= 2 && text.front() == '[' && text.back() == ']') text = text.substr(1, text.size() - 2);
  std::array<float, N> values = {};
  for (size_t i = 0; i < N; ++i) {
    const size_t comma = text.find(',');
    const bool last = i + 1 == N;
    if ((comma == std::string_view::npos) != last)
      return "expected " + std::to_string(N) + " numbers with commas between them";
    std::string_view number = text.substr(0, comma);
    number.remove_prefix(std::min(number.find_first_not_of(' '), number.size()));
    if (Complaint complaint = from_text(field, number, values[i]); !complaint.empty()) return complaint;
    if (!last) text.remove_prefix(comma + 1);
  }
  out = values;
  return {};
}
template <class Enum>
Complaint from_text(const Field& field, std::string_view text, Enum& out) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return store_name(field, text, out);
}

// --- finding a setting by its name
// -------------------------------------------------------------------------------

/// Calls `f(field, value)` for the setting, if there is one. @return whether there is
template <class F>
bool with_field(Config& config, std::string_view section, std::string_view key, F&& f) {
  bool found = false;
  for_each_field(config, [&](const Field& field, auto& value) {
    if (section != field.section || key != field.key) return;
    found = true;
    f(field, value);
  });
  return found;
}

/// Keys of a section as "section.key"; of all sections when there is none of that name.
std::vector<std::string> known_keys(std::string_view section) {
  std::vector<std::string> in_section, all;
  Config config;
  for_each_field(config, [&](const Field& field, auto& /*value*/) {
    all.push_back(field.name());
    if (section == field.section) in_section.push_back(field.name());
  });
  return in_section.empty() ? all : in_section;
}

std::vector<std::string> known_sections() {
  std::vector<std::string> names;
  Config::sections([&](const char* section, auto /*member*/) { names.emplace_back(section); });
  return names;
}

std::string unknown_key(std::string_view section, std::string_view key) {
  const std::string name = std::string(section) + "." + std::string(key);
  return "unknown key " + name + "; did you mean " + nearest(name, known_keys(section)) + "?";
}

// --- TOML files
// --------------------------------------------------------------------------------------------------

void read_section(const std::string& file, std::string_view section, const toml::table& table, Config& config,
                  std::vector<std::string>& problems) {
  for (const auto& [toml_key, node] : table) {
    const std::string_view key = toml_key.str();
    const std::string where = at_line(file, node.source());
    const bool known =
        with_field(config, section, key, [&, &value_node = node](const Field& field, auto& value) {
          const Complaint complaint = from_toml(field, value_node, value);
          if (!complaint.empty()) problems.push_back(where + field.name() + ": " + complaint);
        });
    if (!known) problems.push_back(where + unknown_key(section, key));
  }
}

Result<Config> read_config(const toml::table& root, const std::string& file) {
  Config config;
  std::vector<std::string> problems;
  const std::vector<std::string> sections = known_sections();
  for (const auto& [toml_key, node] : root) {
    const std::string section(toml_key.str());
    const std::string where = at_line(file, node.source());
    if (std::find(sections.begin(), sections.end(), section) == sections.end())
      problems.push_back(where + "unknown section or key " + section + "; did you mean [" +
                         nearest(section, sections) + "]?");
    else if (const toml::table* table = node.as_table())
      read_section(file, section, *table, config, problems);
    else
      problems.push_back(where + section + " is a section: expected [" + section + "] with keys below it");
  }
  if (!problems.empty()) return Error{toml_text::list(problems), ErrorKind::bad_usage};
  return config;
}

}  // namespace

Result<Config> parse_config(const std::string& text, const std::string& name) {
  const Result<toml::table> root = toml_text::parse(text, name);
  if (!root) return Error{root.error(), ErrorKind::bad_usage};
  return read_config(*root, name);
}

Result<Config> load_config(const std::string& path) {
  const Result<std::string> text = read_file(path, toml_text::kMaxFileBytes);
  if (!text) return Error{text.error(), ErrorKind::bad_usage};
  return parse_config(*text, path);
}

Result<Done> apply_setting(Config& config, const std::string& setting) {
  const auto refused = [&](const std::string& why) {
    return Error{"--set " + setting + ": " + why, ErrorKind::bad_usage};
  };
  const size_t equals = setting.find('=');
  const size_t dot = setting.find('.');
  if (equals == std::string::npos || dot == std::string::npos || dot > equals)
    return refused("expected section.key=value");
  const std::string_view all = setting;
  const std::string_view section = all.substr(0, dot);
  const std::string_view key = all.substr(dot + 1, equals - dot - 1);
  Complaint complaint;
  const bool known = with_field(config, section, key, [&](const Field& field, auto& value) {
    complaint = from_text(field, all.substr(equals + 1), value);
  });
  if (!known) return refused(unknown_key(section, key));
  if (!complaint.empty()) return refused(complaint);
  return Done{};
}

}  // namespace stillmap
