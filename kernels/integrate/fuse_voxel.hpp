#pragma once

// One voxel against one frame (paper sections III-A and III-D).

#include <cstdint>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// What a frame says about a voxel.
enum class Seen : uint8_t {
  nothing,  ///< outside the view, no static measurement, or hidden behind the surface
  free,     ///< in front of the surface by tau or more
  band      ///< within the truncation band
};

struct Observation {
  Seen seen = Seen::nothing;
  float sdf_m = 0;  ///< (-tau, tau], only for `band`
  int32_t row = 0, col = 0;
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

/// Projective signed distance along the optical axis: measured depth minus depth of the voxel.   test:
/// integrate_test
STILLMAP_HD Observation observe(const FrameGeometry& g, Vec3 p_cam) {
  Observation o;
  if (!(p_cam.z >= g.min_m)) return o;
  const Pixel px = project(g.k, p_cam);
  // Also refuses what would not fit an integer.
  if (!(px.u > -0.5f && px.v > -0.5f && px.u < static_cast<float>(g.static_depth_m.cols) - 0.5f &&
        px.v < static_cast<float>(g.static_depth_m.rows) - 0.5f))
    return o;
  o.col = static_cast<int32_t>(px.u + 0.5f);
  o.row = static_cast<int32_t>(px.v + 0.5f);
  const float z_m = g.static_depth_m.at(o.row, o.col);
  if (z_m <= 0.0f) return o;
  o.sdf_m = z_m - p_cam.z;
  if (o.sdf_m >= g.truncation_m)
    o.seen = p_cam.z <= g.free_max_m ? Seen::free : Seen::nothing;
  else if (o.sdf_m > -g.truncation_m && z_m <= g.max_m)
    o.seen = Seen::band;
  return o;
}

/// Weighted running mean of the signed distance, rounded to the nearest unit: no bias.            test:
/// integrate_test
STILLMAP_HD void fuse_distance(VoxelSurface& surface, VoxelRecord& record, float sdf_units,
                               int32_t weight_cap) {
  const int32_t w = record.weight;
  const float old = w == 0 ? 0.0f : static_cast<float>(surface.sdf);
  surface.sdf = static_cast<int16_t>(rintf(old + (sdf_units - old) / static_cast<float>(w + 1)));
  record.weight = static_cast<uint8_t>(w < weight_cap ? w + 1 : weight_cap);
}

/// The same mean for a free voxel, whose observation is tau. It moves by at least one unit, so that what is
/// seen free long enough becomes exactly free (paper III-D). test: integrate_test
STILLMAP_HD void fuse_free(VoxelSurface& surface, VoxelRecord& record, int32_t weight_cap) {
  const int32_t w = record.weight;
  if (w == 0) {
    surface.sdf = kSdfMax;
  } else {
    const int32_t gap = kSdfMax - surface.sdf;
    const int32_t step = (gap + w) / (w + 1);  // rounded up
    surface.sdf = static_cast<int16_t>(surface.sdf + step);
  }
  record.weight = static_cast<uint8_t>(w < weight_cap ? w + 1 : weight_cap);
}

/// A number in [0, 1) from voxel and frame: rounds chroma up or down with the right probability, so that
/// eight bits do not bias the running mean.
STILLMAP_HD float dither(uint32_t voxel, uint32_t frame) {
  uint32_t h = voxel * 0x9e3779b1u ^ (frame + 1u) * 0x85ebca77u;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 13;
  return static_cast<float>(h >> 8) * (1.0f / 16777216.0f);
}

/// Weighted running mean of colour: luminance at 16 bits, chroma at 8 bits dithered.               test:
/// integrate_test
STILLMAP_HD void fuse_colour(VoxelSurface& surface, VoxelRecord& record, Rgb8 colour, int32_t weight_cap,
                             float dither01) {
  const int32_t w = record.colour_weight;
  const float keep = 1.0f / static_cast<float>(w + 1);
  const float y = luminance(colour);
  const float cb = 128.0f + (static_cast<float>(colour.b) - 255.0f * y) * (1.0f / 1.8556f);
  const float cr = 128.0f + (static_cast<float>(colour.r) - 255.0f * y) * (1.0f / 1.5748f);
  const float old_y = static_cast<float>(surface.luma), old_cb = static_cast<float>(record.cb),
              old_cr = static_cast<float>(record.cr);
  surface.luma = static_cast<uint16_t>(old_y + (y * kLumaScale - old_y) * keep + 0.5f);
  record.cb = static_cast<uint8_t>(fminf(old_cb + (cb - old_cb) * keep + dither01, 255.0f));
  record.cr = static_cast<uint8_t>(fminf(old_cr + (cr - old_cr) * keep + dither01, 255.0f));
  record.colour_weight = static_cast<uint8_t>(w < weight_cap ? w + 1 : weight_cap);
}

}  // namespace stillmap
