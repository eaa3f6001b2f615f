#include "tests/parity/preset.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <type_traits>

namespace stillmap::parity {
namespace {

/// Place of `name` in "a|b|c"; -1: not there.
int place_of(const std::string& names, const std::string& name) {
  std::istringstream all(names);
  std::string one;
  for (int i = 0; std::getline(all, one, '|'); ++i)
    if (one == name) return i;
  return -1;
}

/// @return false: not a value of this kind
template <class T>
bool read(const std::string& text, const char* unit, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    value = text == "true";
    return text == "true" || text == "false";
  } else if constexpr (std::is_enum_v<T>) {
    const int place = text.size() > 2 ? place_of(unit, text.substr(1, text.size() - 2)) : -1;
    if (place >= 0) value = static_cast<T>(place);
    return place >= 0;
  } else {
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end);
    value = static_cast<T>(number);
    return end != text.c_str() && *end == '\0';
  }
}

enum class Found { no, good, bad };

template <class Section>
Found set(Section& section, const std::string& key, const std::string& text) {
  Found found = Found::no;
  Section::fields(
      [&](const char* name, auto member, double, double, const char* unit, const char*, const char*) {
        if (key == name) found = read(text, unit, section.*member) ? Found::good : Found::bad;
      });
  return found;
}

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r"), last = text.find_last_not_of(" \t\r");
  return first == std::string::npos ? std::string() : text.substr(first, last - first + 1);
}

}  // namespace

Result<EngineParams> engine_params_of(const std::string& path) {
  std::ifstream file(path);
  if (!file) return Error{path + ": cannot be read"};
  EngineParams p;
  std::string line, section;
  for (int n = 1; std::getline(file, line); ++n) {
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    if (line.front() == '[') {
      section = line;
      continue;
    }
    const size_t equals = line.find('=');
    const std::string key = trimmed(line.substr(0, equals));
    const std::string value = equals == std::string::npos ? std::string() : trimmed(line.substr(equals + 1));
    const Found found = section == "[depth]"        ? set(p.depth, key, value)
                        : section == "[track]"      ? set(p.track, key, value)
                        : section == "[mask]"       ? set(p.mask, key, value)
                        : section == "[integrate]"  ? set(p.integrate, key, value)
                        : section == "[map]"        ? set(p.map, key, value)
                        : section == "[relocalise]" ? set(p.relocalise, key, value)
                                                    : Found::good;
    if (found != Found::good) return Error{path + ":" + std::to_string(n) + ": cannot be used: " + line};
  }
  return p;
}

}  // namespace stillmap::parity
