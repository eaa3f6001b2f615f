#pragma once

#include <cstdint>

#include "kernels/base/vec.hpp"

namespace stillmap {

/// Pinhole camera, pixels. The centre of the top-left pixel is (0, 0).
struct Intrinsics {
  float fx = 0, fy = 0, cx = 0, cy = 0;
  int32_t width = 0, height = 0;
};

/// Brown-Conrady coefficients in OpenCV's order; all 0 means none.
struct Distortion {
  float k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;

  STILLMAP_HD bool none() const { return k1 == 0 && k2 == 0 && p1 == 0 && p2 == 0 && k3 == 0; }
};

struct CameraModel {
  Intrinsics k;
  Distortion distortion;
};

struct Pixel {
  float u = 0;  ///< column
  float v = 0;  ///< row
};

/// Pixel of a point, pinhole without distortion.                        test: pinhole_test
/// @param p_cam metres, z > 0
STILLMAP_HD Pixel project(const Intrinsics& k, Vec3 p_cam) {
  const float inv_z = 1.0f / p_cam.z;
  return {k.fx * p_cam.x * inv_z + k.cx, k.fy * p_cam.y * inv_z + k.cy};
}

/// Point of a pixel at depth `z_m`, paper Eq. (1).                      test: pinhole_test
STILLMAP_HD Vec3 unproject(const Intrinsics& k, float u, float v, float z_m) {
  return {(u - k.cx) / k.fx * z_m, (v - k.cy) / k.fy * z_m, z_m};
}

/// Where the ideal pixel (u, v) lies in the distorted image; over a number type (base/lane.hpp).
template <class F>
STILLMAP_HD void distort(const CameraModel& camera, F& u, F& v) {
  const Intrinsics& k = camera.k;
  const Distortion& d = camera.distortion;
  const F x = (u - F(k.cx)) * F(1.0f / k.fx), y = (v - F(k.cy)) * F(1.0f / k.fy);
  const F r2 = x * x + y * y, xy = x * y;
  const F radial = F(1.0f) + r2 * (F(d.k1) + r2 * (F(d.k2) + r2 * F(d.k3)));
  const F xd = x * radial + F(2.0f * d.p1) * xy + F(d.p2) * (r2 + F(2.0f) * x * x);
  const F yd = y * radial + F(d.p1) * (r2 + F(2.0f) * y * y) + F(2.0f * d.p2) * xy;
  u = F(k.fx) * xd + F(k.cx);
  v = F(k.fy) * yd + F(k.cy);
}

/// The same of one pixel.                                               test: pinhole_test
STILLMAP_HD Pixel distort(const CameraModel& camera, Pixel p) {
  distort(camera, p.u, p.v);
  return p;
}

/// The same camera for every `step`-th pixel (levels by sub-sampling, paper section III-B).
STILLMAP_HD Intrinsics subsampled(const Intrinsics& k, int32_t step) {
  const float s = 1.0f / static_cast<float>(step);
  return {k.fx * s, k.fy * s, k.cx * s, k.cy * s, (k.width + step - 1) / step, (k.height + step - 1) / step};
}

/// The camera whose pixels are cells of `px` x `px` pixels; whole cells only, and the
/// centre of cell (r, c) is pixel (r, c).                              test: small_view_test
STILLMAP_HD Intrinsics shrunk(const Intrinsics& k, int32_t px) {
  const float s = 1.0f / static_cast<float>(px), middle = 0.5f * static_cast<float>(px - 1);
  return {k.fx * s, k.fy * s, (k.cx - middle) * s, (k.cy - middle) * s, k.width / px, k.height / px};
}

}  // namespace stillmap
