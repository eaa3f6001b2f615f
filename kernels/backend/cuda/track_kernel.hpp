#pragma once

// A pass of the registration: residual, weights, Jacobian and sums in one kernel; its last block adds up the
// blocks, solves, and decides on the step.

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/track/pose_search.hpp"
#include "kernels/track/track_pass.hpp"

namespace stillmap {

/// What a registration works on.
struct TrackState {
  TrackPass pass;          ///< but for pose and kernel
  float kernel_m[3] = {};  ///< by level
  TrackParams params;
  PosePrior prior;
  PoseSearch search;
  uint32_t arrived = 0;  ///< blocks of the pass under way
};

struct TrackKernel {
  static constexpr uint32_t kLanes = 256;
  static constexpr uint32_t kMostBlocks = 160;
  static constexpr uint32_t kStrands = kLanes / kTerms;  ///< partial sums of one term, in the last block
  struct Shared {
    NormalEqT<float> warps[kLanes / kWarp];
    double strands[kStrands][kTerms];
    NormalEq total;
    bool last;
  };
  TrackState* state;
  View<NormalEqT<float>> partial;  ///< by block
  int32_t rows, cols;              ///< of the image
  int32_t sample;                  ///< pixels between the points of the finest level
  int32_t level, most_steps;
  bool first;  ///< pass of its level

  /// Points are taken by lanes two at a time; so blocks and their sums follow from the image alone.
  static uint32_t blocks(int32_t rows, int32_t cols, int32_t step) {
    const int32_t points = ((rows + step - 1) / step) * ((cols + step - 1) / step);
    const uint32_t wanted = blocks_for(static_cast<uint64_t>(points), 2 * kLanes);
    return wanted < 1 ? 1 : wanted < kMostBlocks ? wanted : kMostBlocks;
  }

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const PoseSearch& search = state->search;
    if (!first && search.level_done) return;
    TrackPass pass = state->pass;
    pass.T_map_cam = first ? search.T_map_cam : search.T_try;
    pass.weights.kernel_m = state->kernel_m[level];
    Shared& s = block.shared();
    PerLane<Block, NormalEqT<float>> sums;
    add_points(block, pass, sums);
    add_lanes(block, sums, s);
    block.each([&](uint32_t lane) {
      if (lane < kTerms) partial[block.index()].sum[lane] = sum_of_warps(s, lane);
    });
    if (is_last_block(block, &state->arrived, s.last)) finish(block, s);
  }

 private:
  template <class Block>
  STILLMAP_GRID void add_points(Block& block, const TrackPass& pass,
                                PerLane<Block, NormalEqT<float>>& sums) const {
    const int32_t step = sample << level;
    const int32_t across = (cols + step - 1) / step, down = (rows + step - 1) / step;
    const auto points = static_cast<uint32_t>(across * down);
    block.privately([&](uint32_t lane) {
      NormalEqT<float> own;
      BlockCache cache;
      for (uint32_t i = block.index() * kLanes + lane; i < points; i += block.count() * kLanes) {
        const auto n = static_cast<int32_t>(i);
        pass(n / across * step, n % across * step, cache, own);
      }
      sums[lane] = own;
    });
  }
  /// Sums of the warps into shared memory.
  template <class Block>
  STILLMAP_GRID static void add_lanes(Block& block, PerLane<Block, NormalEqT<float>>& sums, Shared& s) {
    STILLMAP_UNROLL
    for (int32_t term = 0; term < kTerms; ++term) {
      PerLane<Block, float> x;
      block.privately([&](uint32_t lane) { x[lane] = sums[lane].sum[term]; });
      STILLMAP_UNROLL
      for (uint32_t n = kWarp / 2; n > 0; n /= 2) {
        const PerLane<Block, float> other = block.shuffle_down(x, n);
        block.privately([&](uint32_t lane) { x[lane] += other[lane]; });
      }
      block.privately([&](uint32_t lane) {
        if (lane % kWarp == 0) s.warps[lane / kWarp].sum[term] = x[lane];
      });
    }
    block.each([](uint32_t) {});
  }
  STILLMAP_GRID static float sum_of_warps(const Shared& s, uint32_t term) {
    float sum = 0;
    for (const NormalEqT<float>& warp : s.warps) sum += warp.sum[term];
    return sum;
  }
  template <class Block>
  STILLMAP_GRID void finish(Block& block, Shared& s) const {
    block.each([&](uint32_t lane) {
      const uint32_t term = lane % kTerms, strand = lane / kTerms;
      if (strand >= kStrands) return;
      double sum = 0;
      for (uint32_t b = strand; b < block.count(); b += kStrands)
        sum += static_cast<double>(partial[b].sum[term]);
      s.strands[strand][term] = sum;
    });
    block.each([&](uint32_t lane) {
      if (lane >= kTerms) return;
      double sum = 0;
      for (uint32_t i = 0; i < kStrands; ++i) sum += s.strands[i][lane];
      s.total.sum[lane] = sum;
    });
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      PoseSearch& search = state->search;
      if (first) search.start_level(1 << level, most_steps);
      search.take(s.total, state->prior, state->params);
    });
  }
};

}  // namespace stillmap
