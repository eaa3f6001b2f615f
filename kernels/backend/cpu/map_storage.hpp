#pragma once

#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Owner of the map's memory on the CPU: table, pool, voxels and their counters.
/// @thread the engine's caller
class MapStorage {
 public:
  /// Takes the memory from `arena` (which may be only measuring).
  void carve(Arena& arena, const MapParams& params);
  void clear();

  const VolumeView& view() const { return view_; }
  MapHealth health() const;

  /// Finds or makes a block; a new one is unobserved. Anything but inserted and existed is counted.
  InsertResult insert(BlockKey key);

  /// True when the pool is fuller than map.high_water.
  bool above_high_water() const { return used_[0] > high_water_blocks_; }
  /// Gives up the blocks farthest from `centre_map` until a tenth of the pool is free. Counted.
  void drop_farthest(Vec3 centre_map);

 private:
  void clear_table();
  /// Makes the table anew from `block_keys`: it has no removal of single keys.
  void rebuild_table();

  VolumeView view_;
  View<uint32_t> used_;  ///< one element: blocks taken from the pool
  View<BlockId> order_;  ///< scratch of drop_farthest
  uint32_t high_water_blocks_ = 0;
  MapHealth health_;
};

}  // namespace stillmap
