#pragma once

// Numbers that both engines derive from their parameters. Host code.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "kernels/engine.hpp"
#include "kernels/integrate/visible_blocks.hpp"
#include "kernels/map/block_ref.hpp"
#include "kernels/mask/cells.hpp"
#include "kernels/track/track_pass.hpp"

namespace stillmap {

constexpr int32_t kLongestStep = 4;  ///< of the finest level; that of the coarsest is four times as long

/// A length or count of 640x480 pixels, scaled to the image.
inline int32_t scaled_px(int32_t px_at_640, int32_t width) {
  return static_cast<int32_t>(std::lround(static_cast<double>(px_at_640) * width / 640.0));
}
inline int32_t scaled_pixels(int32_t pixels_at_vga, const Intrinsics& k) {
  return static_cast<int32_t>(static_cast<double>(pixels_at_vga) * k.width * k.height / (640.0 * 480.0));
}

/// Farthest that a frame can change the map, along the optical axis.
inline float far_plane_m(const EngineParams& p) {
  return std::max(p.integrate.free_max_m, p.depth.max_m) + p.map.truncation_m;
}

/// From the camera to the corner of its view at the far plane: no view box is longer than twice this.
inline float reach_m(const EngineParams& p) {
  const Intrinsics& k = p.camera.k;
  const float x = std::max(std::fabs(k.cx), std::fabs(static_cast<float>(k.width) - k.cx)) / k.fx;
  const float y = std::max(std::fabs(k.cy), std::fabs(static_cast<float>(k.height) - k.cy)) / k.fy;
  return far_plane_m(p) * std::sqrt(1.0f + x * x + y * y);
}

/// At the finest level of the registration: 1: every pixel; n: every n-th one of every n-th row.
inline int32_t finest_step(const EngineParams& p) {
  int32_t step = 1;
  while (p.track.sample_cols > 0 && step < kLongestStep && p.camera.k.width > step * p.track.sample_cols)
    step *= 2;
  return step;
}

/// Looks after which space is reliably empty.
/// @param empty_frames frames in mask.empty_s
inline int32_t empty_looks(const EngineParams& p, int32_t empty_frames) {
  return std::min(std::max(p.mask.empty_looks, empty_frames), p.integrate.weight_cap);
}
/// VisibleGroupPass::first_looks: no turns before it is known whether space is empty.
inline uint32_t first_looks(const EngineParams& p, int32_t empty_frames) {
  return static_cast<uint32_t>(std::max(VisibleGroupPass::kFirstLooks, empty_looks(p, empty_frames)));
}

/// How far a map has come from where it began.
struct MapExtent {
  Vec3 began_at;
  float farthest_m = 0;

  void see(const Se3& T_map_cam, bool first) {
    if (first) *this = {T_map_cam.translation, 0.0f};
    farthest_m = std::max(farthest_m, norm(T_map_cam.translation - began_at));
  }
  /// What of a map does not fit itself, for it grew along a path (mask.drift).
  float drift_m(const MaskParams& mask) const { return std::min(mask.drift * farthest_m, kMostDriftM); }

 private:
  static constexpr float kMostDriftM = 0.04f;  ///< beyond it a mover could hide
};
/// A surface contradicts a map only where it is farther off than that may have drifted, and a strip of that
/// width along an edge is nothing.
inline MaskParams allowing(MaskParams mask, float drift_m) {
  constexpr float kStripM = 0.5f;
  mask.contradict_m += drift_m;
  mask.blob_m2 += kStripM * drift_m;
  return mask;
}

/// Neighbouring points err together, the more of them the finer the samples.
inline float correlated_points(const EngineParams& p) {
  const float pixels = static_cast<float>(p.camera.k.width) * static_cast<float>(p.camera.k.height);
  const auto step = static_cast<float>(finest_step(p));
  return std::max(1.0f, p.track.correlated_points * pixels / (640.0f * 480.0f * step * step));
}

inline float group_m(const MapParams& map) {
  return map.voxel_m * static_cast<float>(kBlockEdge * kGroupEdge);
}

/// Groups that the largest view box can hold: its edges are at most the view's longest diagonal.
inline uint64_t max_groups(const EngineParams& p) {
  const auto edge =
      static_cast<uint64_t>(std::ceil((1.2f * reach_m(p) + 2.0f * p.fetch_m) / group_m(p.map))) + 3;
  return edge * edge * edge;
}

/// Each block with voxels once, and each that was seen in part.
inline uint64_t max_visible(const EngineParams& p) {
  return 2 * static_cast<uint64_t>(p.map.pool_blocks);
}

/// The kernel of a level: wide where the picture is coarse and the pose not yet known well.
inline void set_kernel(const EngineParams& params, int32_t step, TrackWeights& weights) {
  const TrackParams& p = params.track;
  constexpr float kSquared_m = 1e9f;
  if (p.kernel == RobustKernel::huber) {
    weights.kernel_m = p.huber_depth_m > 0 ? p.huber_depth_m : kSquared_m;
    return;
  }
  weights.kernel_m = step >= 4 ? p.kernel_coarse_m : step == 2 ? p.kernel_middle_m : p.kernel_fine_m;
  weights.kernel_m += p.kernel_sigmas * params.depth.noise_m;
  weights.kernel_per_range2 = p.kernel_sigmas * params.depth.noise_per_m2;
}

/// A pass over the prepared images, whose views the engine sets, without the kernel of a level.
inline TrackPass track_pass_at(const EngineParams& params, const VolumeView& map, const Se3& T_map_cam) {
  TrackPass pass;
  pass.map = map;
  pass.k = params.camera.k;
  pass.T_map_cam = T_map_cam;
  pass.max_m = params.depth.max_m;
  const TrackParams& p = params.track;
  pass.weights = {map.sdf_unit_m(), 1.0f / params.map.voxel_m, p.colour_weight, p.inlier_m, p.kernel};
  return pass;
}

/// What the cells are compared with at a pose.
/// @param map of the engine's memory  @param empty_frames frames in mask.empty_s
inline CellEvidencePass evidence_pass(const EngineParams& params, const VolumeView& map,
                                      const CellGrid& cells, const Se3& T_map_cam, const DepthNoise& noise,
                                      int32_t empty_frames) {
  constexpr int32_t kCoarsest = 2;
  TrackPass track = track_pass_at(params, map, T_map_cam);
  track.k = cells.k;
  set_kernel(params, kCoarsest, track.weights);
  const MaskParams p = allowing(params.mask, cells.drift_m);
  return {cells,
          track,
          noise,
          p.contradict_m,
          p.contradict_sigmas,
          empty_looks(params, empty_frames),
          static_cast<int32_t>(std::lround(p.empty_reach_m / params.map.voxel_m)),
          static_cast<int32_t>(std::lround(cells.drift_m / params.map.voxel_m))};
}

/// The pose of the camera after an increment about its centre (see TrackPass).
inline Se3 moved_about_centre(const Se3& T_map_cam, const Twistd& motion) {
  const Se3d T = cast<double>(T_map_cam), turn = exp(Twistd{{}, motion.w});
  return cast<float>(Se3d{orthonormalized(turn.rotation * T.rotation), T.translation + motion.v});
}

/// See Engine::look_up.
template <class Cache>
STILLMAP_HD PointState point_state(const VolumeView& map, Vec3 p_map, Cache& cache) {
  const Vec3 grid = (1.0f / map.voxel_m) * p_map + Vec3{0.5f, 0.5f, 0.5f};
  const Int3 voxel = {static_cast<int32_t>(floorf(grid.x)), static_cast<int32_t>(floorf(grid.y)),
                      static_cast<int32_t>(floorf(grid.z))};
  const BlockAt block = lookup(map, pack(block_of_voxel(voxel)), cache);
  const int16_t sdf = block ? block.surface(index_in_block(voxel)).sdf : kSdfUnobserved;
  return sdf == kSdfUnobserved ? PointState::unknown : sdf > 0 ? PointState::free : PointState::occupied;
}

}  // namespace stillmap
