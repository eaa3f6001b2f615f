#pragma once

// The map seen along one ray. Maths of one pixel; no loop over pixels.

#include <cmath>
#include <cstdint>

#include "kernels/base/view.hpp"
#include "kernels/extract/surface_rule.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Blocks looked up lately. Rays of neighbouring pixels run through the same few dozen blocks.
using RayBlocks = RecentBlocks<9>;

/// A ray in the map frame: the point at depth z lies at origin + z direction (direction: camera z is 1).
struct Ray {
  Vec3 origin_m;
  Vec3 direction;
  float near_m = 0;  ///< depths, camera z
  float far_m = 0;
  bool through_backs =
      false;  ///< surfaces seen from behind are passed; false: they end the ray, seeing nothing
};

struct RayHit {
  float depth_m = 0;  ///< camera z; 0: nothing
  Rgb8 colour;
};

namespace ray_detail {

constexpr int32_t kMaxSteps = 1 << 13;  ///< a step is a voxel or more, or crosses a border of blocks
constexpr int32_t kMaxRefinements = 12;
constexpr float kStepShare = 0.8f;          ///< of the distance to the surface
constexpr float kInterpolateVoxels = 2.0f;  ///< nearer to the surface distances are interpolated
constexpr float kPreciseVoxels = 0.01f;

/// Voxel coordinates that a block key can hold, with a margin. False for NaN.
STILLMAP_HD bool in_grid(Vec3 g) {
  constexpr float limit = static_cast<float>((kBlockCoordinateLimit - 2) * kBlockEdge);
  return fabsf(g.x) < limit && fabsf(g.y) < limit && fabsf(g.z) < limit;
}

/// floorf for what is in_grid; a call of the library on machines of the baseline.
STILLMAP_HD int32_t round_down(float x) {
  const int32_t cut = static_cast<int32_t>(x);
  return cut - static_cast<int32_t>(x < static_cast<float>(cut));
}

/// A voxel with the block that holds it, which may be unknown.
struct VoxelAt {
  BlockAt block;
  int32_t index;

  /// kSdfUnobserved also when the block is unknown.
  STILLMAP_HD int16_t sdf() const { return block ? block.surface(index).sdf : kSdfUnobserved; }
};

/// The eight voxels about a point in voxel units, and where it lies between them.
struct CornersAt {
  VoxelAt voxel[8];
  Vec3 fraction;
};

template <class Blocks>
STILLMAP_HD CornersAt corners_at(const VolumeView& map, Vec3 g, Blocks& blocks) {
  CornersAt out;
  const Int3 base = {round_down(g.x), round_down(g.y), round_down(g.z)};
  out.fraction = {g.x - static_cast<float>(base.x), g.y - static_cast<float>(base.y),
                  g.z - static_cast<float>(base.z)};
  const Int3 local = {base.x & 7, base.y & 7, base.z & 7};
  const BlockAt block = lookup(map, pack(block_of_voxel(base)), blocks);
  for (int32_t i = 0; i < 8; ++i) {
    const Int3 step = {i & 1, i >> 1 & 1, i >> 2};
    const Int3 at = local + step;
    const bool leaves = ((at.x | at.y | at.z) & kBlockEdge) != 0;
    out.voxel[i] = {leaves ? lookup(map, pack(block_of_voxel(base + step)), blocks) : block,
                    index_in_block(at)};
  }
  return out;
}

/// Interpolated distance in units of the map. False: a corner is unobserved.
STILLMAP_HD bool interpolate(const CornersAt& corners, float& sdf) {
  float value[8];
  for (int32_t i = 0; i < 8; ++i) {
    const int16_t corner = corners.voxel[i].sdf();
    if (corner == kSdfUnobserved) return false;
    value[i] = static_cast<float>(corner);
  }
  sdf = trilinear(value, corners.fraction);
  return true;
}

/// Distance of the corner next to the point. False: it is unobserved.
STILLMAP_HD bool nearest(const CornersAt& corners, float& sdf) {
  const Vec3 f = corners.fraction;
  const int16_t corner =
      corners.voxel[(f.x >= 0.5f ? 1 : 0) | (f.y >= 0.5f ? 2 : 0) | (f.z >= 0.5f ? 4 : 0)].sdf();
  sdf = static_cast<float>(corner);
  return corner != kSdfUnobserved;
}

/// The rule of the mesh: a cell with a far corner is the rim of what was seen, no surface.
STILLMAP_HD bool is_surface(const CornersAt& corners) {
  for (const VoxelAt v : corners.voxel)
    if (is_far(v.sdf())) return false;
  return true;
}

/// Mean of the corners that have colour, weighted as for interpolation.
STILLMAP_HD Rgb8 colour_at(const CornersAt& corners) {
  float luma = 0, cb = 0, cr = 0, sum = 0;
  for (int32_t i = 0; i < 8; ++i) {
    const VoxelAt v = corners.voxel[i];
    const VoxelRecord record = v.block.record(v.index);
    if (record.colour_weight == 0) continue;
    const Vec3 f = corners.fraction;
    const float w = (i & 1 ? f.x : 1.0f - f.x) * (i & 2 ? f.y : 1.0f - f.y) * (i & 4 ? f.z : 1.0f - f.z);
    luma += w * static_cast<float>(v.block.surface(v.index).luma);
    cb += w * static_cast<float>(record.cb);
    cr += w * static_cast<float>(record.cr);
    sum += w;
  }
  if (!(sum > 0.0f)) return kUncoloured;
  const float inv = 1.0f / sum;
  return colour_from(luma * inv * (1.0f / kLumaScale), cb * inv, cr * inv);
}

/// How far in z until the ray leaves the block, from `h` (voxel units, half a voxel added).
STILLMAP_HD float exit_m(Vec3 h, Vec3 d, Int3 block) {
  const auto along = [](float at, float rate, int32_t low) {
    if (rate == 0.0f) return 3.4e38f;
    const float to = static_cast<float>((rate > 0.0f ? low + 1 : low) * kBlockEdge);
    return (to - at) / rate;
  };
  return min_of(along(h.x, d.x, block.x), min_of(along(h.y, d.y, block.y), along(h.z, d.z, block.z)));
}

/// A stretch of a ray that begins outside and ends inside; distances in voxels.
struct Bracket {
  float outside_m, outside_sdf;
  float inside_m, inside_sdf;
};

/// Narrows the bracket down to where the interpolated distance is 0 (false position, Illinois variant).
template <class Blocks>
STILLMAP_HD RayHit refine_hit(const VolumeView& map, Vec3 o, Vec3 d, Bracket b, Blocks& blocks) {
  const float voxels_per_unit = map.sdf_unit_m() / map.voxel_m;
  int last_side = 0;
  for (int32_t i = 1;; ++i) {
    const float share = b.outside_sdf / (b.outside_sdf - b.inside_sdf);
    const float t = b.outside_m + share * (b.inside_m - b.outside_m);
    const Vec3 g = o + t * d;
    const CornersAt corners = corners_at(map, g, blocks);
    float sdf;
    const bool known = interpolate(corners, sdf);
    if (!known && !nearest(corners, sdf)) return {};
    sdf *= voxels_per_unit;
    if (fabsf(sdf) < kPreciseVoxels || i == kMaxRefinements)
      return known && is_surface(corners) ? RayHit{t, colour_at(corners)} : RayHit{};
    if (sdf < 0.0f) {
      b.inside_m = t;
      b.inside_sdf = sdf;
      if (last_side < 0) b.outside_sdf *= 0.5f;
      last_side = -1;
    } else {
      b.outside_m = t;
      b.outside_sdf = sdf;
      if (last_side > 0) b.inside_sdf *= 0.5f;
      last_side = 1;
    }
  }
}

}  // namespace ray_detail

/// First crossing from outside to inside (distance from + to -) along the ray. An inside that is entered out
/// of the unobserved is no surface; a crossing from inside to outside shows the back of one and ends the
/// ray, unless `through_backs`.                                           test: cast_ray_test
/// @return nothing also for a ray that is not finite
/// @thread any; `blocks` belongs to the caller and to one state of the map
template <class Blocks>
STILLMAP_HD RayHit cast_ray(const VolumeView& map, const Ray& ray, Blocks& blocks) {
  using namespace ray_detail;
  const float inv = 1.0f / map.voxel_m;
  const Vec3 o = inv * ray.origin_m, d = inv * ray.direction;
  const float m_per_voxel = 1.0f / sqrtf(dot(d, d));
  const float voxels_per_unit = map.sdf_unit_m() * inv;
  if (!(m_per_voxel > 0.0f)) return {};

  float t = ray.near_m, t_outside = 0, s_outside = 0;
  int side = 0;  // of the last observed sample, 1 outside; 0: unobserved
  for (int32_t step = 0; step < kMaxSteps && t < ray.far_m; ++step) {
    const Vec3 g = o + t * d;
    if (!in_grid(g)) return {};
    const Vec3 h = {g.x + 0.5f, g.y + 0.5f, g.z + 0.5f};
    const Int3 voxel = {round_down(h.x), round_down(h.y), round_down(h.z)};
    const BlockAt block = lookup(map, pack(block_of_voxel(voxel)), blocks);
    if (!block || (block.voxels == map.free_block && !block.seen)) {
      // All of it unknown, or all of it free: the ray leaves it at once.
      t_outside = t;
      s_outside = static_cast<float>(kSdfMax) * voxels_per_unit;
      if (block && side < 0 && !ray.through_backs) return {};
      t += max_of(exit_m(h, d, block_of_voxel(voxel)), 0.0f) + 0.01f * m_per_voxel;
      side = block ? 1 : 0;
      continue;
    }
    const int16_t sdf = block.surface(index_in_block(voxel)).sdf;
    if (sdf == kSdfUnobserved) {
      t += m_per_voxel;
      side = 0;
      continue;
    }
    float s = static_cast<float>(sdf) * voxels_per_unit;
    if (fabsf(s) < kInterpolateVoxels) {
      float fine;
      if (interpolate(corners_at(map, g, blocks), fine)) s = fine * voxels_per_unit;
    }
    if (s < 0.0f && side > 0) return refine_hit(map, o, d, {t_outside, s_outside, t, s}, blocks);
    if (s >= 0.0f && side < 0 && !ray.through_backs) return {};
    side = s < 0.0f ? -1 : 1;
    t_outside = t;
    s_outside = s;
    t += max_of(1.0f, kStepShare * fabsf(s)) * m_per_voxel;
  }
  return {};
}

}  // namespace stillmap
