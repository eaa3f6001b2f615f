#pragma once

// How much of the static surface that the camera saw is in the mesh.

#include <cstdint>
#include <vector>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

inline constexpr uint32_t kSeenFrames = 30;        ///< a second of frames
inline constexpr size_t kSurfacePoints = 100'000;  ///< of the true cloud are watched, evenly picked

/// Counts for each point of a true cloud in how many frames the camera measured it. @thread one
class SeenSurface {
 public:
  /// @param cloud_world metres
  explicit SeenSurface(const std::vector<Vec3>& cloud_world, size_t max_points = kSurfacePoints);

  /// A point is seen where it projects into the view, the depth there is valid and lies within 3 cm plus the
  /// sensor's noise (4 mm per square metre) of it, and no mover is there.
  /// @param T_world_cam true  @param truth_mask as RgbdFrame's; no data: nothing moves
  /// test: surface_score_test
  void look(const Se3d& T_world_cam, const Intrinsics& k, ImageView<const float> depth_m,
            ImageView<const uint8_t> truth_mask);

  /// Points seen in at least `frames` frames, source's world.
  std::vector<Vec3> seen(uint32_t frames = kSeenFrames) const;

 private:
  std::vector<Vec3> points_world_;
  std::vector<uint32_t> frames_;
};

/// Share of `points` that have one of `vertices` within `limit_m`; same frame, metres. NaN without points.
/// test: surface_score_test
double share_within(const std::vector<Vec3>& points, const std::vector<Vec3>& vertices, float limit_m);

}  // namespace stillmap
