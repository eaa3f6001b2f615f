#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace stillmap {

/// What `doctor` asks of the machine that it runs on. Tests put a folder in place of the root of /sys, /proc,
/// /dev and /etc, and answers in place of the system's.
struct Machine {
  static constexpr uint64_t kUnlimited = ~uint64_t{0};

  std::string root;                                      ///< before every path; empty: this machine
  std::function<bool(const std::string& path)> may_use;  ///< read and write it; below `root`
  std::function<uint64_t()> realtime_limit;              ///< highest SCHED_FIFO priority that is allowed
  std::function<uint64_t()> locked_limit_bytes;          ///< kUnlimited: as much as there is
  std::function<bool()> clock_synchronised;              ///< by NTP or PTP
  std::function<std::optional<uint64_t>(const std::string& folder)> free_bytes;
  std::function<std::string(const std::string& path)>
      video_node;  ///< name and formats; empty: it says nothing
  /// What keeps a GPIO line from being taken, one line; empty: nothing. Null: this build has no
  /// libgpiod.
  std::function<std::string(const std::string& chip, int32_t line)> gpio_problem;

  /// First line of a file, empty where it cannot be read.
  std::string line(const std::string& path) const;
  /// All of a file, at most a megabyte.
  std::string text(const std::string& path) const;
  bool exists(const std::string& path) const;
  bool is_folder(const std::string& path) const;
  /// Full paths (without `root`) of what is in a folder, sorted; empty where there is no such folder.
  std::vector<std::string> list(const std::string& folder) const;
};

/// The machine that the program runs on.
Machine this_machine();

}  // namespace stillmap
