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

/// Where a part that contradicts the map, or lies off it, has slid since `earlier`, its cells do not count as
/// still: their count starts again (cells.still, Part::settled).    test: slide_test
/// @param earlier about mask.reabsorb_s ago; @param T_earlier_now pose of this camera in that one's
/// frame, by the motion that most of the space agrees on
void restart_sliding(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                     const DepthNoise& noise, const EarlierCells& earlier, const Se3& T_earlier_now);

}  // namespace stillmap
