#include "runtime/record/run_folder.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "runtime/record/output_file.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 14> kRunNames = {
    "trajectory.txt",  "states.csv", "timing.csv", "mesh.ply",    "report.json", "events.log", "truth.txt",
    "truth_cloud.ply", "map.smap",   "masks",      "masks_truth", "snapshots",   "pictures",   "config.toml"};

bool ends_with(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// Whether `name` is what a run (or `picture`) leaves in its folder.
bool of_a_run(std::string_view name) {
  if (ends_with(name, ".part")) name.remove_suffix(5);
  // A stream that was rotated: NAME.1, NAME.2, ...
  if (const size_t dot = name.find_last_of('.');
      dot != name.npos && dot + 1 < name.size() && name.find_first_not_of("0123456789", dot + 1) == name.npos)
    name = name.substr(0, dot);
  return std::find(kRunNames.begin(), kRunNames.end(), name) != kRunNames.end() || ends_with(name, ".lcm") ||
         ends_with(name, ".png");
}

std::string reason(const fs::path& path, const char* what, const std::error_code& code) {
  return path.string() + ": cannot " + what + ": " + code.message();
}

std::vector<fs::path> files_of_earlier_run(const fs::path& dir, std::error_code& code) {
  std::vector<fs::path> found;
  for (fs::directory_iterator it(dir, code), end; !code && it != end; it.increment(code))
    if (of_a_run(it->path().filename().string())) found.push_back(it->path());
  return found;
}

bool is_unclosed_log(const fs::path& file) {
  return ends_with(file.filename().string(), ".lcm.part");
}

fs::path previous(const fs::path& dir, int32_t n) {
  return dir / ("previous-" + std::to_string(n));
}

/// previous-N becomes previous-(N+1); what is above `keep` goes.
std::string shift_previous(const fs::path& dir, int32_t keep) {
  std::error_code code;
  for (int32_t n = std::max(keep, 1); fs::exists(previous(dir, n), code); ++n) {
    fs::remove_all(previous(dir, n), code);
    if (code) return reason(previous(dir, n), "be removed", code);
  }
  for (int32_t n = keep - 1; n >= 1; --n) {
    if (!fs::exists(previous(dir, n), code)) continue;
    fs::rename(previous(dir, n), previous(dir, n + 1), code);
    if (code) return reason(previous(dir, n), "be moved", code);
  }
  return {};
}

/// An event log that its run did not close is readable all the same: nobody writes it any more.
fs::path name_when_closed(const fs::path& file) {
  return is_unclosed_log(file) ? file.stem() : file.filename();
}

/// @param unclosed_logs counts those of the earlier run
std::string move_earlier_run(const fs::path& dir, int32_t keep, uint32_t& unclosed_logs) {
  std::error_code code;
  const std::vector<fs::path> files = files_of_earlier_run(dir, code);
  if (code) return reason(dir, "be read", code);
  if (files.empty()) return {};
  if (std::string error = shift_previous(dir, keep); !error.empty()) return error;
  if (keep > 0) fs::create_directory(previous(dir, 1), code);
  if (code) return reason(previous(dir, 1), "be made", code);
  for (const fs::path& file : files) {
    unclosed_logs += is_unclosed_log(file);
    if (keep > 0)
      fs::rename(file, previous(dir, 1) / name_when_closed(file), code);
    else
      fs::remove_all(file, code);
    if (code) return reason(file, "be moved away", code);
  }
  return {};
}

/// Permission bits do not tell the whole story (read-only and full disks, root): only writing does.
std::string probe(const fs::path& dir) {
  const std::string path = (dir / ".stillmap-probe").string();
  std::string error = write_whole_file(path, "probe\n");
  std::error_code ignored;
  fs::remove(path, ignored);
  return error.empty()
             ? error
             : dir.string() + ": cannot be written to; give --out a folder that can (" + error + ")";
}

}  // namespace

RunFolder::RunFolder(std::string dir) : dir_(std::move(dir)) {}

Result<RunFolder> RunFolder::open(const std::string& dir, int32_t keep_previous) {
  std::error_code code;
  fs::create_directories(dir, code);
  if (code) return Error{reason(dir, "be made", code)};
  if (!fs::is_directory(dir, code)) return Error{dir + ": is not a folder; give --out the name of a folder"};
  if (std::string error = probe(dir); !error.empty()) return Error{error};
  RunFolder folder(dir);
  if (std::string error = move_earlier_run(dir, keep_previous, folder.unclosed_logs_); !error.empty())
    return Error{error};
  return folder;
}

std::string RunFolder::make(const std::string& name) const {
  std::error_code code;
  fs::create_directory(path(name), code);
  return code ? reason(path(name), "be made", code) : std::string();
}

}  // namespace stillmap
