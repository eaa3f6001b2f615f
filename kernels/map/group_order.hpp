#pragma once

// In which order groups leave a map that is full. Host code of both engines.

#include "kernels/map/block_ref.hpp"

namespace stillmap {

/// A group as it stands in the table.
struct GroupEntry {
  BlockKey key;
  BlockRef ref;
  uint32_t in_view;  ///< not 0: the last frame saw it
};

/// Squared distance of the middle of a group, metres.
inline float distance2(Vec3 centre_map, BlockKey group, float voxel_m) {
  constexpr int32_t half = kGroupEdge * kBlockEdge / 2;
  const Vec3 d =
      voxel_position(first_voxel(block_in_group(unpack(group), 0)) + Int3{half, half, half}, voxel_m) -
      centre_map;
  return dot(d, d);
}

/// Farther groups first. Ties by key: the same order whatever it was before.
struct FartherGroup {
  Vec3 centre_map;
  float voxel_m;

  bool operator()(const GroupEntry& a, const GroupEntry& b) const {
    const float da = distance2(centre_map, a.key, voxel_m), db = distance2(centre_map, b.key, voxel_m);
    return da != db ? da > db : a.key > b.key;
  }
};

/// What goes first stands last: groups with blocks, unless it is the table that is full; of those what is out
/// of view, and of that the farthest.
struct KeptLonger {
  FartherGroup farther;
  bool any_kind;  ///< groups without blocks go as well

  bool operator()(const GroupEntry& a, const GroupEntry& b) const {
    if (!any_kind && has_id(a.ref) != has_id(b.ref)) return has_id(b.ref);
    if ((a.in_view != 0) != (b.in_view != 0)) return a.in_view != 0;
    return farther(b, a);
  }
};

/// Room that is wanted in a pool when groups are given up.
STILLMAP_HD bool has_room(uint32_t used, uint32_t capacity) {
  return used <= capacity - capacity / 10;
}
/// Chains of the table stay short.
STILLMAP_HD uint32_t most_entries(uint32_t slots) {
  return slots / 2;
}

}  // namespace stillmap
