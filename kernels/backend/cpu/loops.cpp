// Loops over element functions, nothing else. Compiled with STILLMAP_LOOPS naming the table (see
// CMakeLists.txt).

#include "kernels/backend/cpu/loops.hpp"

namespace stillmap {
namespace {

int32_t prepare(const PreparePass& pass, int32_t first_row, int32_t last_row) {
  int32_t valid = 0;
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.depth_m.cols; ++c) valid += pass(r, c);
  return valid;
}

NormalEqT<float> track(const TrackPass& pass, int32_t first_row, int32_t last_row, int32_t step) {
  NormalEqT<float> sums;
  BlockCache cache;
  for (int32_t r = first_row; r < last_row; r += step)
    for (int32_t c = 0; c < pass.depth_m.cols; c += step) pass(r, c, cache, sums);
  return sums;
}

void residual_mask(const ResidualMaskPass& pass, int32_t first_row, int32_t last_row) {
  BlockCache cache;
  for (int32_t r = first_row; r < last_row; ++r)
    for (int32_t c = 0; c < pass.depth_m.cols; ++c) pass(r, c, cache);
}

void static_depth(const StaticDepthPass& pass, int32_t tile_row) {
  for (int32_t c = 0; c < pass.tiles.cols; ++c) pass(tile_row, c);
}

GroupView visible_group(const VisibleGroupPass& pass, uint32_t group) {
  return pass(group);
}

void integrate(const IntegratePass& pass, View<const VisibleBlock> blocks) {
  for (const VisibleBlock block : blocks) pass(block);
}

}  // namespace

extern const CpuLoops STILLMAP_LOOPS;
const CpuLoops STILLMAP_LOOPS = {STILLMAP_LOOPS_NAME, prepare,       track,    residual_mask,
                                 static_depth,        visible_group, integrate};

}  // namespace stillmap
