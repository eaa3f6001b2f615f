#pragma once

// One voxel against one frame (paper sections III-A and III-D).

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// What a frame says about a voxel. At most one is true; neither: the voxel is outside the view, has no
/// static measurement on its ray, or is hidden behind the surface.
template <class F>
struct Observation {
  MaskOf<F> free;  ///< in front of the surface by tau or more
  MaskOf<F> band;  ///< within the truncation band
  F sdf_m;         ///< (-tau, tau), of meaning only in the band
  IntOf<F> pixel;  ///< index of the pixel, inside the image whatever was seen
};

/// The frame, as integration needs it.
struct FrameGeometry {
  ImageView<const float> static_depth_m;  ///< 0: nothing known; below 0: minus the depth of a mover
  Intrinsics k;
  float min_m = 0;       ///< nearer than this the camera sees nothing
  float max_m = 0;       ///< measurements beyond make free space only
  float free_max_m = 0;  ///< clipping plane of free space
  float truncation_m = 0;
};

// A surface well inside what was free: a quarter of the weight, four times, and it is as if nothing was
// known.
constexpr float kRelearnFactor = 0.25f;
constexpr float kFreeShare = 0.3f;  ///< of tau
constexpr float kMoverGap = 0.4f;   ///< of tau: this far before a mover space is free
// A surface that is seen through: each look also forgets a tenth, at least one observation. What was seen
// there for long is gone in as few looks as what was seen shortly.
constexpr float kSeenThroughFactor = 0.9f;

/// Projective signed distance along the optical axis: measured depth minus depth of the voxel.
///                                                                       test: integrate_test
template <class F>
STILLMAP_HD Observation<F> observe(const FrameGeometry& g, Vec3T<F> p_cam) {
  const ImageView<const float>& image = g.static_depth_m;
  const F zero = F(0.0f), half = F(0.5f);
  const MaskOf<F> in_front = p_cam.z >= F(g.min_m);
  const F inv_z = F(1.0f) / select(in_front, p_cam.z, F(1.0f));
  // Shifted by half a pixel: truncation is then rounding.
  const F u = F(g.k.fx) * p_cam.x * inv_z + F(g.k.cx) + half,
          v = F(g.k.fy) * p_cam.y * inv_z + F(g.k.cy) + half;
  const MaskOf<F> inside = in_front & (u > zero) & (v > zero) & (u < F(static_cast<float>(image.cols))) &
                           (v < F(static_cast<float>(image.rows)));
  const IntOf<F> col = to_int(select(inside, u, zero)), row = to_int(select(inside, v, zero));
  Observation<F> o;
  o.pixel = row * IntOf<F>(image.pitch) + col;
  const F seen_m = gather_float(image.data, o.pixel), z_m = abs_of(seen_m);
  o.sdf_m = z_m - p_cam.z;
  const MaskOf<F> still = inside & (seen_m > zero), mover = inside & (seen_m < zero);
  // A mover is not fused, so that nothing is in the way of what is free right before it.
  const MaskOf<F> beyond = o.sdf_m >= F(g.truncation_m), before = o.sdf_m >= F(kMoverGap * g.truncation_m);
  o.free = ((still & beyond) | (mover & before)) & (p_cam.z <= F(g.free_max_m));
  o.band = still & !beyond & (o.sdf_m > F(-g.truncation_m)) & (z_m <= F(g.max_m));
  return o;
}

/// Positions of the voxels of one block in the camera frame, metres.
struct VoxelGrid {
  Vec3 origin, dx, dy, dz;

  STILLMAP_HD VoxelGrid(const Se3& T_cam_map, Int3 block, float voxel_m)
      : origin(T_cam_map * voxel_position(first_voxel(block), voxel_m)),
        dx(voxel_m * column(T_cam_map, 0)),
        dy(voxel_m * column(T_cam_map, 1)),
        dz(voxel_m * column(T_cam_map, 2)) {}

  template <class F>
  STILLMAP_HD Vec3T<F> position(F x, int32_t y, int32_t z) const {
    const Vec3 row = origin + static_cast<float>(y) * dy + static_cast<float>(z) * dz;
    return {F(row.x) + F(dx.x) * x, F(row.y) + F(dx.y) * x, F(row.z) + F(dx.z) * x};
  }
  template <class F>
  STILLMAP_HD Vec3T<F> position(F x, F y, F z) const {
    return {F(origin.x) + F(dx.x) * x + F(dy.x) * y + F(dz.x) * z,
            F(origin.y) + F(dx.y) * x + F(dy.y) * y + F(dz.y) * z,
            F(origin.z) + F(dx.z) * x + F(dy.z) * y + F(dz.z) * z};
  }

 private:
  STILLMAP_HD static Vec3 column(const Se3& T, int32_t c) {
    return {T.rotation(0, c), T.rotation(1, c), T.rotation(2, c)};
  }
};

/// One voxel taken apart; all numbers whole.
template <class F>
struct VoxelState {
  F sdf, luma, weight, colour_weight, cb, cr;
};

/// Numbers of one fusion that are the same for all voxels.
struct FuseWeights {
  float units_per_m = 0;  ///< of VoxelSurface::sdf
  float weight_cap = 64;
  bool relearn = false;  ///< what changed soon outweighs what was there
};

/// Weighted running mean of the distance of a voxel (paper III-A), and carving (III-D): in free space the
/// observation is tau.                                                         test: integrate_test
///
/// Rounded to the nearest of 16 bits. A voxel seen free moves by at least one unit, so that what is seen free
/// long enough becomes exactly free.
template <class F>
STILLMAP_HD VoxelState<F> fused_distance(VoxelState<F> v, const Observation<F>& o, const FuseWeights& p) {
  const F one = F(1.0f), tau = F(static_cast<float>(kSdfMax));
  const F old = select(v.weight > F(0.0f), v.sdf, F(0.0f));
  const F observed = select(o.band, o.sdf_m * F(p.units_per_m), tau);
  if (p.relearn) {
    const MaskOf<F> was_free = (old > F(kFreeShare) * tau) & (old - observed > F(kFreeShare) * tau);
    const MaskOf<F> was_surface = old < F(kFreeShare) * tau;
    const F keeps = select(o.band & was_free, F(kRelearnFactor),
                           select(o.free & was_surface, F(kSeenThroughFactor), one));
    v.weight = to_float(to_int(keeps * v.weight));
  }
  const F mean = round_nearest(old + (observed - old) / (v.weight + one));
  const F sdf = select(o.band, mean, min_of(max_of(mean, old + one), tau));
  const MaskOf<F> any = o.free | o.band;
  v.sdf = select(any, sdf, v.sdf);
  v.weight = select(any, min_of(v.weight + one, F(p.weight_cap)), v.weight);
  return v;
}

/// Weighted running mean of the colour of a voxel in the band.                 test: integrate_test
///
/// Luminance is rounded to the nearest of 16 bits, chroma up or down by `dither01`: no bias.
/// @param luma, cb, cr in the units of the voxel
template <class F>
STILLMAP_HD VoxelState<F> fused_colour(VoxelState<F> v, const Observation<F>& o, F luma, F cb, F cr,
                                       const FuseWeights& p, F dither01) {
  const F one = F(1.0f), share = one / (v.colour_weight + one);
  const auto mixed = [&](F from, F to, F rounding) {
    return select(o.band, to_float(to_int(from + (to - from) * share + rounding)), from);
  };
  v.luma = mixed(v.luma, luma, F(0.5f));
  v.cb = mixed(v.cb, cb, dither01);
  v.cr = mixed(v.cr, cr, dither01);
  v.colour_weight = select(o.band, min_of(v.colour_weight + one, F(p.weight_cap)), v.colour_weight);
  return v;
}

/// A number in [0, 1) from voxel and frame: rounds chroma up or down with the right probability, so that
/// eight bits do not bias the running mean.
template <class I>
STILLMAP_HD I dither_bits(I voxel, I frame) {
  I h = wrapping_multiply(wrapping_add(voxel, wrapping_multiply(frame, I(0x3504f333))), I(0x2c1b3c6d));
  h = wrapping_multiply(h ^ shift_right(h, 15), I(0x297a2d39));
  return shift_right(h ^ shift_right(h, 15), 8) & I(0xffff);
}
template <class F>
STILLMAP_HD F dither(IntOf<F> voxel, int32_t frame) {
  return to_float(dither_bits(voxel, IntOf<F>(frame))) * F(1.0f / 65536.0f);
}

}  // namespace stillmap
