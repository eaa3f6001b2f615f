#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"

namespace stillmap {

/// What the name of a file of an event log says: NAME-000001.lcm, with `.part` behind it while it is open.
struct LogFileName {
  uint32_t number = 0;
  bool part = false;
};

/// @return nothing: no file of the log `name`
std::optional<LogFileName> parse_log_file_name(std::string_view name, std::string_view file);

/// The files of an event log in their order.
/// @param path a file: it and those that follow it by number (alone when its name has no number); a folder:
/// all of its log, which is named `log`
/// @return kind cannot_open when there is none.  @thread boot
Result<std::vector<std::string>> find_log_files(const std::string& path);

}  // namespace stillmap
