#pragma once

#include <cstdint>

#include "kernels/integrate/fuse_voxel.hpp"

namespace stillmap {

/// One entry of the list of visible blocks: id, and in the top bits whether all of the block is seen free, or
/// whether it is the id of SeenVoxels.
struct VisibleBlock {
  uint32_t bits;

  static constexpr uint32_t kFree = 1u << 31, kPartly = 1u << 30;
  STILLMAP_HD uint32_t id() const { return bits & ~(kFree | kPartly); }
  STILLMAP_HD bool all_free() const { return (bits & kFree) != 0; }
  STILLMAP_HD bool partly() const { return (bits & kPartly) != 0; }
};

/// VolumeView::settled_free of a block without a surface: all its voxels are free or unobserved. It can do
/// without voxels.
constexpr uint8_t kNoSurfaceLeft = 2;

/// Fuses one frame into one visible block: distance, colour, free space and carving (paper III-A, III-D).
///
/// `Voxels` reads and writes what F holds: one voxel (PlainVoxels below), or a row of them (backend/cpu).
struct IntegratePass {
  VolumeView map;
  FrameGeometry geometry;
  const LumaChroma* colour;  ///< same pixels as geometry.static_depth_m
  Se3 T_cam_map;
  FuseWeights weights;
  bool free_space;    ///< false: a voxel that was never in the band stays unobserved
  int32_t frame;      ///< counts frames, for the dither
  bool dense = true;  ///< false: blocks in which no surface is left are told (kNoSurfaceLeft)

  template <class Voxels>
  STILLMAP_HD void operator()(VisibleBlock visible, const Voxels& voxels) const {
    const BlockId id = visible.id();
    if (visible.partly()) return mark_seen(map.partly[id], voxels);
    if (visible.all_free() && map.settled_free[id]) return;
    VoxelBlock& block = map.blocks[id];
    const VoxelGrid grid(T_cam_map, unpack(map.block_keys[id]), map.voxel_m);
    bool settled = visible.all_free(), touched_band = false;
    for (int32_t z = 0; z < kBlockEdge; ++z)
      for (int32_t y = 0; y < kBlockEdge; ++y)
        for (int32_t x = 0; x < kBlockEdge; x += Voxels::kCount) {
          const Touched touched = fuse(visible, block, grid, voxels, x, y, z);
          settled = settled && !touched.unsettled;
          touched_band |= touched.band;
        }
    note_settled(visible, settled, touched_band, !dense && !touched_band && no_surface_left(block));
  }

  /// What became of the voxels that F holds.
  struct Touched {
    bool unsettled = false;  ///< some may still change when they are seen free again
    bool band = false;       ///< some lie on a surface
  };
  /// One step over the voxels of a block, from (x, y, z) on along x.
  template <class Voxels>
  STILLMAP_HD Touched fuse(VisibleBlock visible, VoxelBlock& block, const VoxelGrid& grid,
                           const Voxels& voxels, int32_t x, int32_t y, int32_t z) const {
    using F = typename Voxels::Number;
    Observation<F> o = {voxels.all(), !voxels.all(), F(0.0f), IntOf<F>(0)};
    if (!visible.all_free()) o = observe(geometry, grid.position<F>(voxels.ramp(x), y, z));
    if (!voxels.any(o.free | o.band)) return {};
    const int32_t i = voxel_index(x, y, z);
    VoxelState<F> state = voxels.load(block, i);
    if (!free_space) o.free = o.free & (state.weight > F(0.0f));
    state = fused_distance(state, o, weights);
    const bool band = voxels.any(o.band);
    if (band) {
      const IntOf<F> voxel = voxels.index(i) + IntOf<F>(static_cast<int32_t>(visible.id()) * kBlockVoxels);
      F luma, cb, cr;
      voxels.load_colour(colour, o.pixel, luma, cb, cr);
      state = fused_colour(state, o, luma, cb, cr, weights, dither<F>(voxel, frame));
    }
    voxels.store(block, i, state);
    return {voxels.any((state.sdf < F(static_cast<float>(kSdfMax))) | (state.weight < F(weights.weight_cap))),
            band};
  }
  /// @param no_surface of a map that is not dense: nothing is in the band, and no surface was left before
  STILLMAP_HD void note_settled(VisibleBlock visible, bool settled, bool touched_band,
                                bool no_surface) const {
    uint8_t& note = map.settled_free[visible.id()];
    if (!dense)
      note = no_surface ? kNoSurfaceLeft : uint8_t{0};
    else if (visible.all_free())
      note = settled;
    else if (touched_band)
      note = 0;
  }

 private:
  STILLMAP_HD static bool no_surface_left(const VoxelBlock& block) {
    int32_t surface = 0;
    for (const VoxelSurface& v : block.surface)
      surface |= static_cast<int32_t>(v.sdf != kSdfMax) & static_cast<int32_t>(v.sdf != kSdfUnobserved);
    return surface == 0;
  }

  template <class Voxels>
  STILLMAP_HD void mark_seen(SeenVoxels& seen, const Voxels& voxels) const {
    using F = typename Voxels::Number;
    const VoxelGrid grid(T_cam_map, unpack(seen.key), map.voxel_m);
    seen.grew = false;
    for (int32_t z = 0; z < kBlockEdge; ++z) {
      uint64_t free = 0;
      for (int32_t y = 0; y < kBlockEdge; ++y)
        for (int32_t x = 0; x < kBlockEdge; x += Voxels::kCount) {
          const Observation<F> o = observe(geometry, grid.position<F>(voxels.ramp(x), y, z));
          free |= static_cast<uint64_t>(voxels.bits(o.free)) << (kBlockEdge * y + x);
        }
      seen.grew |= (free & ~seen.layer[z]) != 0;
      seen.layer[z] |= free;
    }
  }
};

/// Voxels one at a time.
struct PlainVoxels {
  using Number = float;
  static constexpr int32_t kCount = 1;

  STILLMAP_HD bool all() const { return true; }
  STILLMAP_HD bool any(bool which) const { return which; }
  STILLMAP_HD uint32_t bits(bool which) const { return which; }
  STILLMAP_HD float ramp(int32_t x) const { return static_cast<float>(x); }
  /// 0 or 1: where corner i lies along an axis.
  STILLMAP_HD float corner(int32_t i, int32_t axis) const { return static_cast<float>(i >> axis & 1); }
  STILLMAP_HD float least(float x) const { return x; }
  STILLMAP_HD float most(float x) const { return x; }
  STILLMAP_HD int32_t index(int32_t i) const { return i; }
  STILLMAP_HD VoxelState<float> load(const VoxelBlock& block, int32_t i) const {
    const VoxelSurface s = block.surface[i];
    const VoxelRecord r = block.record[i];
    return {static_cast<float>(s.sdf),           static_cast<float>(s.luma), static_cast<float>(r.weight),
            static_cast<float>(r.colour_weight), static_cast<float>(r.cb),   static_cast<float>(r.cr)};
  }
  STILLMAP_HD void store(VoxelBlock& block, int32_t i, const VoxelState<float>& v) const {
    block.surface[i] = {static_cast<int16_t>(v.sdf), static_cast<uint16_t>(v.luma)};
    block.record[i] = {static_cast<uint8_t>(v.weight), static_cast<uint8_t>(v.colour_weight),
                       static_cast<uint8_t>(v.cb), static_cast<uint8_t>(v.cr)};
  }
  STILLMAP_HD void load_colour(const LumaChroma* image, int32_t pixel, float& luma, float& cb,
                               float& cr) const {
    const LumaChroma c = image[pixel];
    luma = static_cast<float>(c.luma), cb = static_cast<float>(c.cb), cr = static_cast<float>(c.cr);
  }
};

}  // namespace stillmap
