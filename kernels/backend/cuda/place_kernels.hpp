#pragma once

// The search for a lost camera on the GPU: a block of lanes follows one try from its start to its end.

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/raycast/raycast_pass.hpp"
#include "kernels/relocalise/place_store.hpp"

namespace stillmap {

/// Scratch of one try.
struct TryScratch {
  ModelView model;
  View<Rgb8> colour;
  ImageView<float> expected_m, map_luma;
};

/// As CpuRelocaliser::follow does it; the sums are taken in another order.
struct FollowTriesKernel {
  static constexpr uint32_t kLanes = 256;
  struct Sums {
    AlignSums sums;
    STILLMAP_HD friend Sums operator+(const Sums& a, const Sums& b) {
      Sums c = a;
      c.sums.eq.add(b.sums.eq);
      c.sums.measured_luma += b.sums.measured_luma;
      c.sums.map_luma += b.sums.map_luma;
      return c;
    }
  };
  struct Shared {
    Sums sums[kLanes / kWarp];
    VerdictCounts verdicts[kLanes / kWarp];
    LumaCorrelation luma[kLanes / kWarp];
    PoseTry the_try;
    ModelView model;
    float gain;
    bool go_on;
  };
  VolumeView map;
  View<PoseTry> tries;
  TryScratch scratch[PlaceStore::kMaxTries];
  SmallView view[2];
  Intrinsics view_k[2];
  RelocaliseParams params;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    Shared& s = block.shared();
    const TryScratch& own = scratch[block.index()];
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      s.the_try = tries[block.index()];
      s.the_try.check = ViewCheck{};
      s.model = own.model;
      s.go_on = true;
    });
    for (int32_t i = 0; i < kModelAlignments && s.go_on; ++i) {
      if (i == 0 || i == kNewViewBefore) cast_model(block, s, own);
      align_to_model(block, s, model_alignment(i));
    }
    if (s.go_on) align_to_map(block, s);
    if (s.go_on) check_view(block, s, own);
    block.each([&](uint32_t lane) {
      if (lane == 0) tries[block.index()] = s.the_try;
    });
  }

 private:
  /// f(row, col) over an image, spread over the lanes.
  template <class Block, class F>
  STILLMAP_GRID static void for_cells(Block& block, int32_t rows, int32_t cols, const F& f) {
    for_all_in_block(block, static_cast<uint32_t>(rows * cols),
                     [&](uint32_t i) { f(static_cast<int32_t>(i) / cols, static_cast<int32_t>(i) % cols); });
  }
  /// Sum of what f(row, col, sum) adds.
  template <class T, class Block, class F>
  STILLMAP_GRID static T sum_of_cells(Block& block, const SmallView& small, T* warps, const F& f) {
    const int32_t cols = small.depth_m.cols;
    PerLane<Block, T> sum;
    block.privately([&](uint32_t lane) {
      sum[lane] = T{};
      for (uint32_t i = lane; i < static_cast<uint32_t>(small.depth_m.pixels()); i += kLanes)
        f(static_cast<int32_t>(i) / cols, static_cast<int32_t>(i) % cols, sum[lane]);
    });
    return sum_over_block(block, sum, warps);
  }

  template <class Block>
  STILLMAP_GRID void cast(Block& block, const Se3& T_map_cam, const Intrinsics& k, ImageView<float> depth_m,
                          Rgb8* colour) const {
    const RaycastPass pass{map, k, T_map_cam, depth_m, {colour, k.height, k.width, k.width}};
    for_cells(block, k.height, k.width, [&](int32_t r, int32_t c) {
      BlockCache cache;
      pass(r, c, cache);
    });
  }
  template <class Block>
  STILLMAP_GRID void cast_model(Block& block, Shared& s, const TryScratch& own) const {
    block.each([&](uint32_t lane) {
      if (lane == 0) s.model.T_map_model = s.the_try.T_map_cam;
    });
    cast(block, s.model.T_map_model, s.model.k, s.model.depth_m, own.colour.data);
    const NormalPass normals{s.model};
    for_cells(block, s.model.k.height, s.model.k.width, [&](int32_t r, int32_t c) { normals(r, c); });
  }

  template <class Block>
  STILLMAP_GRID void align_to_model(Block& block, Shared& s, ModelAlignment alignment) const {
    for (int32_t i = 0; i < alignment.steps && s.go_on; ++i) {
      const ModelAlignPass pass{view[1], view_k[1], s.model, s.the_try.T_map_cam, alignment.gate_m};
      const Sums all = sum_of_cells<Sums>(block, view[1], s.sums,
                                          [&](int32_t r, int32_t c, Sums& sum) { pass(r, c, sum.sums); });
      block.each([&](uint32_t lane) {
        if (lane == 0)
          s.go_on = all.sums.eq.sum[kInliers] >= kLeastOnModel * view[1].depth_m.pixels() &&
                    align_step(all.sums.eq, s.the_try.T_map_cam);
      });
    }
  }

  template <class Block>
  STILLMAP_GRID void align_to_map(Block& block, Shared& s) const {
    block.each([&](uint32_t lane) {
      if (lane == 0) s.gain = 1.0f;
    });
    for (int32_t i = 0; i < kMapSteps && s.go_on; ++i) {
      const float gate_m = i > kMapSteps / 2 ? kNarrowMapGate_m : kMapGate_m;
      const MapAlignPass pass{map, view[0], view_k[0], s.the_try.T_map_cam, gate_m, kMapColourWeight, s.gain};
      const Sums all = sum_of_cells<Sums>(block, view[0], s.sums, [&](int32_t r, int32_t c, Sums& sum) {
        BlockCache cache;
        pass(r, c, cache, sum.sums);
      });
      block.each([&](uint32_t lane) {
        if (lane == 0) s.go_on = step_on_map(all.sums, s);
      });
    }
  }
  STILLMAP_GRID bool step_on_map(const AlignSums& sums, Shared& s) const {
    if (sums.eq.sum[kInliers] < kLeastOnMap * view[0].depth_m.pixels()) return false;
    s.the_try.check.weakest_m = weakest_direction_m(sums.eq);
    if (!align_step(sums.eq, s.the_try.T_map_cam)) return false;
    if (sums.map_luma > 0) s.gain = static_cast<float>(sums.measured_luma / sums.map_luma);
    return true;
  }

  template <class Block>
  STILLMAP_GRID VerdictCounts count_verdicts(Block& block, Shared& s, const ViewCheckPass& pass) const {
    return sum_of_cells<VerdictCounts>(block, view[0], s.verdicts,
                                       [&](int32_t r, int32_t c, VerdictCounts& sum) {
                                         BlockCache cache;
                                         ++sum.count[static_cast<int32_t>(pass(r, c, cache))];
                                       });
  }
  template <class Block>
  STILLMAP_GRID void check_view(Block& block, Shared& s, const TryScratch& own) const {
    ViewCheckPass pass{map, view[0], view_k[0], s.the_try.T_map_cam, {}, own.map_luma};
    const VerdictCounts before = count_verdicts(block, s, pass);
    const LumaCorrelation correlation = sum_of_cells<LumaCorrelation>(
        block, view[0], s.luma,
        [&](int32_t r, int32_t c, LumaCorrelation& sum) { sum.add(view[0].luma, own.map_luma, r, c); });
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      ViewCheck& check = s.the_try.check;
      check.cells = before.cells();
      check.on = before.share(CellVerdict::on);
      check.luma_correlation = correlation.luma.value();
      check.texture_correlation = correlation.texture.value();
      s.go_on = worth_a_view(check, params);
    });
    if (!s.go_on) return;
    cast(block, s.the_try.T_map_cam, view_k[0], own.expected_m, own.colour.data);
    pass.expected_m = own.expected_m;
    const VerdictCounts all = count_verdicts(block, s, pass);
    block.each([&](uint32_t lane) {
      if (lane == 0) write_shares(all, s.the_try.check);
    });
  }
};

}  // namespace stillmap
