#pragma once

#include <string>

#include "config/result.hpp"
#include "kernels/engine.hpp"

namespace stillmap::parity {

/// The engine's part of a preset file: `key = value` lines under `[section]`, as config/presets has them. The
/// whole configuration with its checks needs a TOML library, and this program has none.
Result<EngineParams> engine_params_of(const std::string& path);

}  // namespace stillmap::parity
