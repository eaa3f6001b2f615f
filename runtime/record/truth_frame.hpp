#pragma once

#include <optional>
#include <vector>

#include "kernels/base/se3.hpp"

namespace stillmap {

/// Brings the truth of a source into the map frame: T_map_world = T_map_cam0 * inverse(T_world_cam0), where 0
/// is the first frame that was mapped.
class TruthFrame {
 public:
  /// Only the first call counts.
  void anchor(const Se3d& T_map_cam0, const Se3d& T_world_cam0);
  bool anchored() const { return T_map_world_.has_value(); }
  /// Only when anchored.
  Se3d to_map(const Se3d& T_world_cam) const { return *T_map_world_ * T_world_cam; }
  Vec3 to_map(Vec3 p_world) const;

 private:
  std::optional<Se3d> T_map_world_;
};

/// @return the cloud in the map frame, metres
std::vector<Vec3> in_map_frame(const TruthFrame& frame, std::vector<Vec3> points_world);

}  // namespace stillmap
