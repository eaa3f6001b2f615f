#pragma once

#include <string>

#include "config/config.hpp"

namespace stillmap {

/// The configuration as a TOML file: every key, with unit, range, where the paper says it, and what it does.
/// `load_config` reads it back to the same values. `config/presets/default.toml` is `to_toml(Config{})`.
/// @thread boot
std::string to_toml(const Config& config);

}  // namespace stillmap
