#include "drivers/dataset/text.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "config/read_file.hpp"

namespace stillmap {
namespace {

constexpr uint64_t kMaxTextBytes = 64 << 20;

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

std::string stamp_label(Stamp stamp) {
  return fmt::format("{:.6f}", stamp.seconds());
}

bool is_there(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
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

}  // namespace stillmap
