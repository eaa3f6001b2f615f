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

constexpr int32_t kLanes = 8;   ///< points side by side
constexpr int32_t kBatch = 64;  ///< pixels of a row at a time: everything about them stays in the first cache

/// Points that have a value in the map, component by component.
struct PointBatch {
  alignas(32) uint32_t voxel[8][kBatch];
  alignas(32) float fraction[3][kBatch], arm[3][kBatch], luma[kBatch];
  int32_t size = 0;

  void append(const TrackPoint& p) {
    const int32_t i = size++;
    for (int32_t v = 0; v < 8; ++v) __builtin_memcpy(&voxel[v][i], &p.voxel[v], 4);
    fraction[0][i] = p.fraction.x, fraction[1][i] = p.fraction.y, fraction[2][i] = p.fraction.z;
    arm[0][i] = p.arm.x, arm[1][i] = p.arm.y, arm[2][i] = p.arm.z;
    luma[i] = p.luma;
  }
  TrackPoint at(int32_t i) const {
    TrackPoint p;
    for (int32_t v = 0; v < 8; ++v)
      p.voxel[v] = {static_cast<int16_t>(voxel[v][i] & 0xffffu), static_cast<uint16_t>(voxel[v][i] >> 16)};
    p.fraction = {fraction[0][i], fraction[1][i], fraction[2][i]};
    p.arm = {arm[0][i], arm[1][i], arm[2][i]};
    p.luma = luma[i];
    return p;
  }
};

/// Sums of kLanes points side by side.
struct LaneSums {
  alignas(32) float sum[kTerms][kLanes] = {};

  void add(const PointBatch& batch, const TrackWeights& weights) {
    for (int32_t first = 0; first < batch.size; first += kLanes)
      for (int32_t lane = 0; lane < kLanes; ++lane) {
        const TrackPoint p = batch.at(first + lane);
        add_point(point_terms(p, weights), p.arm, first + lane < batch.size ? 1.0f : 0.0f, &sum[0][lane],
                  kLanes);
      }
  }
  NormalEqT<float> total() const {
    NormalEqT<float> sums;
    for (int32_t t = 0; t < kTerms; ++t)
      for (int32_t lane = 0; lane < kLanes; ++lane) sums.sum[t] += sum[t][lane];
    return sums;
  }
};

NormalEqT<float> track(const TrackPass& pass, int32_t first_row, int32_t last_row, int32_t step) {
  LaneSums lanes;
  PointBatch batch = {};
  PixelPoint points[kBatch];
  BlockCache cache;
  float considered = 0;
  for (int32_t r = first_row; r < last_row; r += step)
    for (int32_t c0 = 0; c0 < pass.depth_m.cols; c0 += kBatch * step) {
      const int32_t left = (pass.depth_m.cols - c0 + step - 1) / step, n = left < kBatch ? left : kBatch;
      for (int32_t i = 0; i < n; ++i) points[i] = pass.point_of(r, c0 + i * step);
      batch.size = 0;
      for (int32_t i = 0; i < n; ++i) {
        if (!points[i].usable) continue;
        considered += 1.0f;
        TrackPoint point;
        if (pass.fetch(points[i], r, c0 + i * step, cache, point)) batch.append(point);
      }
      lanes.add(batch, pass.weights);
    }
  NormalEqT<float> sums = lanes.total();
  sums.sum[kConsidered] = considered;
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
