#pragma once

#include <cstdint>
#include <string>

#include "firmware-like/commands/progress.hpp"
#include "firmware-like/commands/run_outputs.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/ports/frame_observer.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// How the frames of a run ended.
struct LoopEnd {
  TrackingState state = TrackingState::good;  ///< after the last frame
  std::string error;  ///< the source broke off; empty when it ended or a stop was asked for
};

/// Reads, processes and records frame after frame until the source ends, `max_frames` were read (0: no limit)
/// or a stop is asked for. Bad frames are counted and passed over. Allocations inside `Pipeline::process` are
/// counted. @param observer null: nobody looks  @param archive null: far parts of a full map are dropped
LoopEnd run_loop(FrameSource& source, Engine& engine, Pipeline& pipeline, RunOutputs& outputs,
                 Progress& progress, RgbdFrame& slot, uint32_t max_frames, FrameObserver* observer,
                 BlockArchive* archive);

}  // namespace stillmap
