#include "runtime/record/truth_frame.hpp"

namespace stillmap {

void TruthFrame::anchor(const Se3d& T_map_cam0, const Se3d& T_world_cam0) {
  if (!T_map_world_) T_map_world_ = T_map_cam0 * inverse(T_world_cam0);
}

Vec3 TruthFrame::to_map(Vec3 p_world) const {
  const Vec3d p = *T_map_world_ * Vec3d{static_cast<double>(p_world.x), static_cast<double>(p_world.y),
                                        static_cast<double>(p_world.z)};
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
}

std::vector<Vec3> in_map_frame(const TruthFrame& frame, std::vector<Vec3> points_world) {
  for (Vec3& p : points_world) p = frame.to_map(p);
  return points_world;
}

}  // namespace stillmap
