#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "config/result.hpp"

namespace stillmap {

/// Writes `text` beside `path` and renames it, so that nobody ever sees half a file.
/// @return nothing when it is there, else one line that names the file and the reason
std::optional<Error> write_file_whole(const std::string& path, std::string_view text);

}  // namespace stillmap
