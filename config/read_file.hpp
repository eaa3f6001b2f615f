#pragma once

#include <cstdint>
#include <string>

#include "config/result.hpp"

namespace stillmap {

/// The bytes of a regular file; devices, pipes and folders are refused, for they may block or never end.
/// @param max_bytes larger files are an error
/// @return one line with the path and the system's reason when it cannot be read
/// @thread any; not the real-time thread
Result<std::string> read_file(const std::string& path, uint64_t max_bytes);

}  // namespace stillmap
