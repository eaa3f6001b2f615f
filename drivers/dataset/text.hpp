#pragma once

// Lines, words and numbers of the text files in a recording.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {
inline namespace dataset_text {

/// Words of a line, separated by blanks, tabs or commas; none for a comment ('#').
std::vector<std::string_view> words_of(std::string_view line);

/// A finite decimal number that is the whole word.
std::optional<double> parse_number(std::string_view word);

/// Seconds in decimal text, with or without exponent, to nanoseconds without a detour over floating point;
/// what is finer than a nanosecond is rounded to nearest. None when it is no number or beyond 100 years.
std::optional<Stamp> parse_stamp(std::string_view word);

/// Seconds with six digits, as the trajectory files have them.
std::string stamp_text(Stamp stamp);

/// One line of a text file that is no comment and not empty.
struct TextLine {
  size_t number;  ///< from 1
  std::vector<std::string_view> words;
};

/// A text file held in memory; the words point into it.
class TextFile {
 public:
  /// @return one line with path and reason, kind cannot_open
  static Result<TextFile> read(const std::string& path);

  const std::string& path() const { return path_; }
  std::vector<TextLine> lines() const;

 private:
  std::string path_, content_;
};

}  // namespace dataset_text
}  // namespace stillmap
