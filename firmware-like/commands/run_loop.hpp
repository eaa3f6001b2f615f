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

struct LoopLimits {
  uint32_t max_frames = 0;     ///< to be read; 0: no limit
  double new_map_after_s = 0;  ///< lost for so long, the map is given up (lost.new_map_after_s); 0: never
};

/// Reads, processes and records frame after frame until the source ends, the limit was reached
/// or a stop is asked for. Bad frames are counted and passed over. Allocations inside `Pipeline::process` are
/// counted. @param observer null: nobody looks  @param archive null: far parts of a full map are dropped
LoopEnd run_loop(FrameSource& source, Engine& engine, Pipeline& pipeline, RunOutputs& outputs,
                 Progress& progress, RgbdFrame& slot, const LoopLimits& limits, FrameObserver* observer,
                 BlockArchive* archive);

}  // namespace stillmap
