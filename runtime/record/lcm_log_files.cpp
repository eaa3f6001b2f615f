#include "runtime/record/lcm_log_files.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <system_error>
#include <utility>

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnd = ".lcm", kPart = ".part";

bool take_end(std::string_view& text, std::string_view end) {
  if (text.size() < end.size() || text.substr(text.size() - end.size()) != end) return false;
  text.remove_suffix(end.size());
  return true;
}

using NumberedFile = std::pair<uint32_t, std::string>;

Error cannot_open(std::string message) {
  return {std::move(message), ErrorKind::cannot_open};
}

/// Files of the log `name` in `folder` from number `first` on.
Result<std::vector<std::string>> files_from(const fs::path& folder, std::string_view name, uint32_t first) {
  std::vector<NumberedFile> found;
  std::error_code code;
  for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code))
    if (const auto parsed = parse_log_file_name(name, it->path().filename().string());
        parsed && parsed->number >= first)
      found.emplace_back(parsed->number, it->path().string());
  if (code) return cannot_open(folder.string() + ": cannot be read: " + code.message());
  std::sort(found.begin(), found.end());
  std::vector<std::string> files;
  for (NumberedFile& file : found) files.push_back(std::move(file.second));
  return files;
}

}  // namespace

std::optional<LogFileName> parse_log_file_name(std::string_view name, std::string_view file) {
  LogFileName parsed;
  parsed.part = take_end(file, kPart);
  if (!take_end(file, kEnd) || !file.starts_with(name)) return std::nullopt;
  file.remove_prefix(name.size());
  if (file.size() < 2 || file.front() != '-') return std::nullopt;
  file.remove_prefix(1);
  const auto [end, error] = std::from_chars(file.data(), file.data() + file.size(), parsed.number);
  if (error != std::errc() || end != file.data() + file.size()) return std::nullopt;
  return parsed;
}

Result<std::vector<std::string>> find_log_files(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    auto files = files_from(path, "log", 0);
    if (files && files->empty())
      return cannot_open(path + ": holds no event log (log-000001.lcm and so on); name the file");
    return files;
  }
  if (!fs::exists(path, ignored)) return cannot_open(path + ": there is no such file");
  const fs::path file(path);
  const std::string name = file.filename().string();
  const std::string log = name.substr(0, std::min(name.rfind('-'), name.size()));
  const auto parsed = parse_log_file_name(log, name);
  if (!parsed) return std::vector<std::string>{path};
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  return files_from(folder, log, parsed->number);
}

}  // namespace stillmap
