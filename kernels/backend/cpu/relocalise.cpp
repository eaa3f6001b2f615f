#include "kernels/backend/cpu/relocalise.hpp"

#include <algorithm>

#include "kernels/backend/cpu/raycast.hpp"
#include "kernels/relocalise/view_check.hpp"

namespace stillmap {
namespace {

template <class Pass>
AlignSums sum_over(const SmallView& view, const Pass& pass) {
  AlignSums sums;
  for (int32_t r = 0; r < view.depth_m.rows; ++r)
    for (int32_t c = 0; c < view.depth_m.cols; ++c) pass(r, c, sums);
  return sums;
}

VerdictCounts count_verdicts(const ViewCheckPass& pass) {
  RecentBlocks<6> cache;
  VerdictCounts counts;
  for (int32_t r = 0; r < pass.k.height; ++r)
    for (int32_t c = 0; c < pass.k.width; ++c) ++counts.count[static_cast<int32_t>(pass(r, c, cache))];
  return counts;
}

}  // namespace

void CpuRelocaliser::carve(Arena& arena, const EngineParams& params) {
  store_.carve(arena, params);
  max_m_ = params.depth.max_m;
  if (!store_.enabled()) return;
  const Intrinsics &k = store_.view_k(0), wide = widened(store_.view_k(1));
  for (Scratch& s : scratch_) {
    s.model.k = wide;
    s.model.depth_m = arena.take_image<float>("relocalisation: views", wide.height, wide.width);
    s.model.normal = arena.take_image<Vec3>("relocalisation: views", wide.height, wide.width);
    s.colour =
        arena.take<Rgb8>("relocalisation: views",
                         static_cast<uint64_t>(std::max(wide.width * wide.height, k.width * k.height)));
    s.expected_m = arena.take_image<float>("relocalisation: views", k.height, k.width);
    s.map_luma = arena.take_image<float>("relocalisation: views", k.height, k.width);
  }
}

void CpuRelocaliser::shrink(const PreparedView& frame) const {
  const Intrinsics &fine = store_.view_k(0), &coarse = store_.view_k(1);
  const ShrinkPass shrink{frame.depth_m, frame.colour, frame.mask, store_.cell_px(), max_m_, store_.view(0)};
  for (int32_t r = 0; r < fine.height; ++r)
    for (int32_t c = 0; c < fine.width; ++c) shrink(r, c);
  const HalvePass halve{store_.view(0), store_.view(1)};
  for (int32_t r = 0; r < coarse.height; ++r)
    for (int32_t c = 0; c < coarse.width; ++c) halve(r, c);
}

void CpuRelocaliser::remember(const PreparedView& frame, const Se3& T_map_cam) {
  if (!store_.enabled()) return;
  shrink(frame);
  store_.remember(T_map_cam);
}

PlaceResult CpuRelocaliser::find(const PreparedView& frame, const VolumeView& map, const Se3& T_map_cam_guess,
                                 int32_t attempt, ThreadPool& threads) {
  if (!store_.enabled()) return {};
  shrink(frame);
  auto all = [&](View<PoseTry> tries) {
    threads.for_each(tries.size, [&](uint32_t i) { follow(map, tries[i], scratch_[i]); });
  };
  return store_.find(T_map_cam_guess, attempt, follower(all));
}

PlaceResult CpuRelocaliser::confirm(const PreparedView& frame, const VolumeView& map,
                                    const Se3& T_map_cam_start, ThreadPool& threads) {
  if (!store_.enabled()) return {};
  shrink(frame);
  auto all = [&](View<PoseTry> tries) {
    threads.for_each(tries.size, [&](uint32_t i) { follow(map, tries[i], scratch_[i]); });
  };
  return store_.confirm(T_map_cam_start, follower(all));
}

/// From wide to narrow; the view of the map is made again when the pose has come near.
void CpuRelocaliser::follow(const VolumeView& map, PoseTry& t, Scratch& scratch) const {
  t.check = {};
  for (int32_t i = 0; i < kModelAlignments; ++i) {
    if (i == 0 || i == kNewViewBefore) cast_model(map, t, scratch);
    if (!align_to_model(model_alignment(i), scratch, t)) return;
  }
  if (align_to_map(map, t)) check_view(map, scratch, t);
}

/// The map with its normals from a pose, wider than the frame.
void CpuRelocaliser::cast_model(const VolumeView& map, const PoseTry& t, Scratch& scratch) const {
  scratch.model.T_map_model = t.T_map_cam;
  const Intrinsics& k = scratch.model.k;
  const ImageView<Rgb8> colour{scratch.colour.data, k.height, k.width, k.width};
  raycast_rows({map, k, t.T_map_cam, scratch.model.depth_m, colour}, 0, k.height);
  const NormalPass normals{scratch.model};
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c) normals(r, c);
}

/// @return false when too little of the frame meets the model
bool CpuRelocaliser::align_to_model(ModelAlignment alignment, const Scratch& scratch, PoseTry& t) const {
  const SmallView& view = store_.view(1);
  for (int32_t i = 0; i < alignment.steps; ++i) {
    const AlignSums sums =
        sum_over(view, ModelAlignPass{view, store_.view_k(1), scratch.model, t.T_map_cam, alignment.gate_m});
    if (sums.eq.sum[kInliers] < kLeastOnModel * view.depth_m.pixels() || !align_step(sums.eq, t.T_map_cam))
      return false;
  }
  return true;
}

bool CpuRelocaliser::align_to_map(const VolumeView& map, PoseTry& t) const {
  const SmallView& view = store_.view(0);
  MapAlignPass pass{map, view, store_.view_k(0), t.T_map_cam, kMapGate_m, kMapColourWeight, 1.0f};
  for (int32_t i = 0; i < kMapSteps; ++i) {
    pass.T_map_cam = t.T_map_cam;
    RecentBlocks<6> cache;
    const AlignSums sums = sum_over(view, [&](int32_t r, int32_t c, AlignSums& s) { pass(r, c, cache, s); });
    if (sums.eq.sum[kInliers] < kLeastOnMap * view.depth_m.pixels()) return false;
    t.check.weakest_m = weakest_direction_m(sums.eq);
    if (!align_step(sums.eq, t.T_map_cam)) return false;
    if (sums.map_luma > 0) pass.gain = static_cast<float>(sums.measured_luma / sums.map_luma);
    if (i == kMapSteps / 2) pass.gate_m = kNarrowMapGate_m;
  }
  return true;
}

void CpuRelocaliser::check_view(const VolumeView& map, Scratch& scratch, PoseTry& t) const {
  const Intrinsics& k = store_.view_k(0);
  const SmallView& view = store_.view(0);
  ViewCheckPass pass{map, view, k, t.T_map_cam, {}, scratch.map_luma};
  const VerdictCounts before = count_verdicts(pass);
  t.check.cells = before.cells();
  t.check.on = before.share(CellVerdict::on);
  LumaCorrelation correlation;
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c) correlation.add(view.luma, scratch.map_luma, r, c);
  t.check.luma_correlation = correlation.luma.value();
  t.check.texture_correlation = correlation.texture.value();
  if (!worth_a_view(t.check, store_.params())) return;
  const ImageView<Rgb8> colour{scratch.colour.data, k.height, k.width, k.width};
  raycast_rows({map, k, t.T_map_cam, scratch.expected_m, colour}, 0, k.height);
  pass.expected_m = scratch.expected_m;
  write_shares(count_verdicts(pass), t.check);
}

}  // namespace stillmap
