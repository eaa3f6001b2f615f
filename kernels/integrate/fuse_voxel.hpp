#pragma once

// One voxel against one frame (paper sections III-A and III-D).

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// What a frame says about a voxel.
enum class Seen : int32_t {
  nothing,  ///< outside the view, no static measurement, or hidden behind the surface
  free,     ///< in front of the surface by tau or more
  band      ///< within the truncation band
};

struct Observation {
  Seen seen = Seen::nothing;
  float sdf_m = 0;    ///< (-tau, tau), of meaning only for `band`
  int32_t pixel = 0;  ///< index of the pixel in the image; inside it whatever was seen
};

/// The frame, as integration needs it.
struct FrameGeometry {
  ImageView<const float> static_depth_m;  ///< masked pixels are 0
  Intrinsics k;
  float min_m = 0;       ///< nearer than this the camera sees nothing
  float max_m = 0;       ///< measurements beyond make free space only
  float free_max_m = 0;  ///< clipping plane of free space
  float truncation_m = 0;
};

/// Projective signed distance along the optical axis: measured depth minus depth of the voxel. Without
/// branches.
///                                                                       test: integrate_test
STILLMAP_HD Observation observe(const FrameGeometry& g, Vec3 p_cam) {
  const ImageView<const float>& image = g.static_depth_m;
  const bool in_front = p_cam.z >= g.min_m;
  const float inv_z = 1.0f / (in_front ? p_cam.z : 1.0f);
  const float u = g.k.fx * p_cam.x * inv_z + g.k.cx, v = g.k.fy * p_cam.y * inv_z + g.k.cy;
  const float last_u = static_cast<float>(image.cols) - 0.5f, last_v = static_cast<float>(image.rows) - 0.5f;
  const bool inside = in_front & (u > -0.5f) & (v > -0.5f) & (u < last_u) & (v < last_v);
  const int32_t col = static_cast<int32_t>(inside ? u + 0.5f : 0.0f),
                row = static_cast<int32_t>(inside ? v + 0.5f : 0.0f);
  Observation o;
  o.pixel = row * image.pitch + col;
  const float z_m = image.data[o.pixel];
  o.sdf_m = z_m - p_cam.z;
  const bool measured = inside & (z_m > 0.0f);
  const bool free = measured & (o.sdf_m >= g.truncation_m) & (p_cam.z <= g.free_max_m);
  const bool band = measured & (o.sdf_m < g.truncation_m) & (o.sdf_m > -g.truncation_m) & (z_m <= g.max_m);
  o.seen = band ? Seen::band : free ? Seen::free : Seen::nothing;
  return o;
}

/// A number in [0, 1) from voxel and frame: rounds chroma up or down with the right probability, so that
/// eight bits do not bias the running mean.
STILLMAP_HD float dither(uint32_t voxel, uint32_t frame) {
  uint32_t h = voxel * 0x9e3779b1u ^ (frame + 1u) * 0x85ebca77u;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 13;
  return static_cast<float>(static_cast<int32_t>(h >> 8)) * (1.0f / 16777216.0f);
}

/// Numbers of one fusion that are the same for all voxels.
struct FuseWeights {
  float units_per_m = 0;  ///< of VoxelSurface::sdf
  int32_t weight_cap = 64;
};

/// Weighted running means of distance and colour for one voxel (paper III-A), and carving (III-D): in free
/// space the observation is tau. Without branches, so that a loop over voxels becomes vector code. test:
/// integrate_test
///
/// Distance and luminance are rounded to the nearest of 16 bits, chroma up or down by `dither01`: no bias. A
/// voxel seen free moves by at least one unit, so that what is seen free long enough becomes exactly free.
STILLMAP_HD void fuse_voxel(VoxelSurface& surface, VoxelRecord& record, Seen seen, float sdf_m,
                            LumaChroma colour, const FuseWeights& p, float dither01) {
  const bool band = seen == Seen::band, any = seen != Seen::nothing;
  const int32_t w = record.weight, wc = record.colour_weight;
  const float old = w == 0 ? 0.0f : static_cast<float>(surface.sdf);
  const float observed = band ? sdf_m * p.units_per_m : static_cast<float>(kSdfMax);
  const float mean = rintf(old + (observed - old) / static_cast<float>(w + 1));
  const float freer = fminf(fmaxf(mean, old + 1.0f), static_cast<float>(kSdfMax));
  const float sdf = band ? mean : freer;
  const float share = 1.0f / static_cast<float>(wc + 1);
  const float y = static_cast<float>(surface.luma), cb = static_cast<float>(record.cb),
              cr = static_cast<float>(record.cr);
  const float new_y = y + (static_cast<float>(colour.luma) - y) * share + 0.5f;
  const float new_cb = fminf(cb + (static_cast<float>(colour.cb) - cb) * share + dither01, 255.0f);
  const float new_cr = fminf(cr + (static_cast<float>(colour.cr) - cr) * share + dither01, 255.0f);
  const int32_t next_w = w < p.weight_cap ? w + 1 : w, next_wc = wc < p.weight_cap ? wc + 1 : wc;
  surface.sdf = static_cast<int16_t>(any ? static_cast<int32_t>(sdf) : static_cast<int32_t>(surface.sdf));
  surface.luma =
      static_cast<uint16_t>(band ? static_cast<int32_t>(new_y) : static_cast<int32_t>(surface.luma));
  record.weight = static_cast<uint8_t>(any ? next_w : w);
  record.colour_weight = static_cast<uint8_t>(band ? next_wc : wc);
  record.cb = static_cast<uint8_t>(band ? static_cast<int32_t>(new_cb) : static_cast<int32_t>(record.cb));
  record.cr = static_cast<uint8_t>(band ? static_cast<int32_t>(new_cr) : static_cast<int32_t>(record.cr));
}

}  // namespace stillmap
