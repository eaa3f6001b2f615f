#include "firmware-like/doctor/machine.hpp"

#include <sys/resource.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "drivers/v4l2/node_description.hpp"

namespace stillmap {
namespace {

uint64_t limit(int which) {
  rlimit value{};
  if (getrlimit(static_cast<__rlimit_resource>(which), &value) != 0) return 0;
  return value.rlim_cur == RLIM_INFINITY ? Machine::kUnlimited : value.rlim_cur;
}

bool is_root() {
  return geteuid() == 0;  // limits do not bind it
}

bool synchronised() {
  timex state{};
  return adjtimex(&state) != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
}

std::optional<uint64_t> free_bytes_of(const std::string& folder) {
  struct statvfs disk {};
  if (statvfs(folder.c_str(), &disk) != 0) return {};
  return uint64_t{disk.f_bavail} * uint64_t{disk.f_frsize};
}

std::string video_node_text(const std::string& path) {
  const auto node = describe_node(kernel_calls(), path);
  return node ? summary_text(*node) : std::string();
}

}  // namespace

std::string Machine::text(const std::string& path) const {
  constexpr size_t kMost = 1 << 20;
  std::string content;
  std::ifstream in(root + path);
  for (char c; content.size() < kMost && in.get(c);) content += c;
  return content;
}

std::string Machine::line(const std::string& path) const {
  const std::string content = text(path);
  return content.substr(0, content.find('\n'));
}

bool Machine::exists(const std::string& path) const {
  std::error_code error;
  return std::filesystem::exists(root + path, error);
}

bool Machine::is_folder(const std::string& path) const {
  std::error_code error;
  return std::filesystem::is_directory(root + path, error);
}

std::vector<std::string> Machine::list(const std::string& folder) const {
  std::vector<std::string> paths;
  std::error_code error;
  std::filesystem::directory_iterator entry(root + folder, error), end;
  for (; !error && entry != end; entry.increment(error))
    paths.push_back(folder + "/" + entry->path().filename().string());
  std::sort(paths.begin(), paths.end());
  return paths;
}

Machine this_machine() {
  Machine machine;
  machine.may_use = [](const std::string& path) { return access(path.c_str(), R_OK | W_OK) == 0; };
  machine.realtime_limit = [] { return is_root() ? Machine::kUnlimited : limit(RLIMIT_RTPRIO); };
  machine.locked_limit_bytes = [] { return is_root() ? Machine::kUnlimited : limit(RLIMIT_MEMLOCK); };
  machine.clock_synchronised = synchronised;
  machine.free_bytes = free_bytes_of;
  machine.video_node = video_node_text;
  return machine;
}

}  // namespace stillmap
