#pragma once

// TOML text to tables, with errors in words. For the .cpp files that read TOML only: it pulls in the library.

// With NDEBUG the library tells the optimiser that its assertions hold, and malformed files break one of
// them: undefined behaviour. Like this its own error paths behind them are taken.
#undef NDEBUG
#define TOML_ASSERT(expr) static_assert(true)
#include <toml++/toml.h>

#include <exception>
#include <string>
#include <vector>

#include "config/result.hpp"

namespace stillmap::toml_text {

/// Of any file that is read.
inline constexpr uint64_t kMaxFileBytes = 1 << 20;

/// "FILE:LINE: "
inline std::string at_line(const std::string& file, const toml::source_region& source) {
  return file + ":" + std::to_string(source.begin.line) + ": ";
}

/// One a line.
inline std::string list(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : "\n") + line;
  return text;
}

/// The only place where the library throws.
inline Result<toml::table> parse(const std::string& text, const std::string& file) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    return Error{at_line(file, error.source()) + "not valid TOML: " + std::string(error.description()),
                 ErrorKind::bad_usage};
  } catch (const std::exception& error) {
    return Error{file + ": not valid TOML: " + error.what(), ErrorKind::bad_usage};
  }
}

}  // namespace stillmap::toml_text
