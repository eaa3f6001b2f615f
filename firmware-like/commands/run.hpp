#pragma once

#include "firmware-like/commands/run_options.hpp"
#include "runtime/ports/frame_observer.hpp"

namespace stillmap {

/// `stillmap run` with these flags. @param observer sees every frame; null: nobody looks
/// @return the exit code
int run(const RunOptions& options, FrameObserver* observer = nullptr);

}  // namespace stillmap
