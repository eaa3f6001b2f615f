#pragma once

// A whole registration by the passes of an engine, and what it amounts to. Host code.

#include "kernels/base/normal_eq.hpp"
#include "kernels/engine.hpp"
#include "kernels/params.hpp"
#include "kernels/track/pose_search.hpp"

namespace stillmap {

/// Which levels a registration goes through.
struct LevelRange {
  int32_t coarsest = 2, finest = 0;
};

/// Sums of one pass over every `step`-th pixel at a pose. A plain function and its context: nothing is
/// allocated.
struct PassRunner {
  NormalEq (*run)(void* context, const Se3& T_map_cam, int32_t step) = nullptr;
  void* context = nullptr;

  NormalEq operator()(const Se3& T_map_cam, int32_t step) const { return run(context, T_map_cam, step); }
};

/// Minimises E_d + w_c E_c from `T_start`.                              test: track_test
/// @param prior enters as one more residual, weighed as track.prior_point_m says
/// @param min_points with fewer points that have a value in the map the answer is `degenerate`, at the finest
/// level
/// @return status ok, or degenerate with T_world_cam = T_start
/// @thread the engine's caller
TrackResult register_frame(const PassRunner& pass, const Se3& T_start, const TrackParams& params,
                           LevelRange levels, int32_t min_points, const PosePrior& prior = {});

/// What a search that has come to its end amounts to; parameters as of register_frame.
TrackResult result_of(const PoseSearch& search, const Se3& T_start, int32_t finest_level, int32_t min_points);

}  // namespace stillmap
