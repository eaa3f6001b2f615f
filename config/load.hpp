#pragma once

#include <string>

#include "config/config.hpp"
#include "config/result.hpp"

namespace stillmap {

/// Reads a TOML file over the defaults. Unknown sections and keys, wrong types, names that a switch does not
/// have and numbers that are not finite are errors, all of them listed, one a line: file, line, key, what was
/// expected. Ranges are not looked at here: see `violations`.
/// @return an error of kind bad_usage
/// @thread boot
Result<Config> load_config(const std::string& path);

/// The same from text; `name` stands for the file in messages.
Result<Config> parse_config(const std::string& text, const std::string& name);

/// Sets one value from the command line.
/// @param setting "section.key=value"; names of a switch with or without quotes
Result<Done> apply_setting(Config& config, const std::string& setting);

}  // namespace stillmap
