#pragma once

#include "firmware-like/commands/run_options.hpp"

namespace stillmap {

/// `stillmap run` with these flags. @return the exit code
int run(const RunOptions& options);

}  // namespace stillmap
