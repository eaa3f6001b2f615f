#pragma once

// The files of a recording: which of them are there, lines and words of the text files.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"
#include "runtime/core/number_text.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Words of a line, separated by blanks, tabs or commas; none for a comment ('#').
std::vector<std::string_view> words_of(std::string_view line);

/// Seconds with six digits, as the trajectory files have them.
std::string stamp_label(Stamp stamp);

/// Whether a recording has this file or folder; what nobody may look at is not there.
bool is_there(const std::filesystem::path& path);

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

}  // namespace stillmap
