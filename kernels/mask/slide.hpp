#pragma once

// Whether a part that seems to stand still slides along its own surface: too little for any one of its cells
// to show from one frame to the next, but not for all of them against a frame that is longer ago. Host code
// of both engines.

#include "kernels/mask/parts.hpp"

namespace stillmap {

/// Cells of an earlier frame.
struct EarlierCells {
  ImageView<float> depth_m, luma;
  Se3 T_map_cam;
};

/// The frames that were kept, one of every `masks_between` masks, in a ring.
struct EarlierFrames {
  const EarlierCells* ring;  ///< kEarlier of them
  uint32_t masks = 0;        ///< made before this one
  uint32_t masks_between = 1;

  /// @param later 1 the oldest, kEarlier - 1 the youngest of which all is kept
  const EarlierCells& at(int32_t later) const {
    return ring[(masks / masks_between + static_cast<uint32_t>(later)) % kEarlier];
  }
  int32_t age(int32_t later) const {  ///< masks
    return static_cast<int32_t>(masks % masks_between) +
           (kEarlier - later) * static_cast<int32_t>(masks_between);
  }
};

/// Where a part that contradicts the map, or lies off it, has slid since `earlier`, its cells do not count as
/// still, or for `frames` at most (cells.still, Part::settled).    test: slide_test
/// @param T_earlier_now pose of this camera in that one's frame, by the motion that most of the space agrees
/// on
void restart_sliding(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                     const DepthNoise& noise, const EarlierCells& earlier, const Se3& T_earlier_now,
                     int32_t frames);

/// The same against each of the frames that were kept, the youngest first: what slid since one of them has
/// stood still since the next at most. Who swings back to where it was then was elsewhere in between.
/// @param T_map_now pose of this camera, by the motion that most of the space agrees on
void restart_sliding(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                     const DepthNoise& noise, const EarlierFrames& earlier, const Se3& T_map_now);

/// Fills Part::slid_m, if some part needs it: parts are compared with each of the frames that were kept as
/// they were with the map, and agree on a motion since. What lies off its place in the map but not in most of
/// those frames has not moved: the map does not fit. Uses Part::motion.                    test: slide_test
/// @param usual see agree_on_motion
void measure_slides(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                    const DepthNoise& noise, const EarlierFrames& earlier, const Se3& T_map_now, float usual);

}  // namespace stillmap
