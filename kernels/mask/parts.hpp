#pragma once

// Decides for whole parts of the picture what moves: segments the cells by depth and bends, and counts for
// each part what contradicts the map. Host code of both engines; the grid is small (about 160 x 120).

#include "kernels/mask/cells.hpp"
#include "kernels/params.hpp"

namespace stillmap {

/// Frames that are kept; the oldest is mask.reabsorb_s old, or a third more.
constexpr int32_t kEarlier = 4;

/// What is known of one connected part of the picture.
struct Part {
  int32_t cells = 0, expected = 0;
  int32_t expected_or_doubted = 0;
  int32_t expected_inside = 0;                     ///< without what was only kTouched
  int32_t row0 = 0, row1 = 0, col0 = 0, col1 = 0;  ///< all its cells lie in here, ends excluded
  int32_t settled = 0;                             ///< cells that stood still for CellGrid::settled_frames
  float known = 0, contradicts = 0;       ///< cells with a value in the map; sum of their contradiction
  float area_m2 = 0, contradicts_m2 = 0;  ///< as seen; of what contradicts
  float noise_m = 0;                      ///< mean of the cells' noise
  NormalEq motion;                        ///< its own least squares by the motion of the camera
  bool near_map = false;        ///< most of it lies near a mapped surface, from which it can have moved
  float moved_m = 0;            ///< how far its surface lies off where the whole picture would have it
  int32_t there = 0, came = 0;  ///< cells where an earlier frame saw a surface, or free space
  /// By earlier frame: how far it lies off its place in that one; < 0: unknown.
  float slides_m[kEarlier - 1] = {};
  float slid_m = 0;      ///< the second largest of them
  bool moved = false;    ///< farther than it may
  bool doubted = false;  ///< for the first time: once more, and it has moved
  bool dynamic = false;
};

/// Memory of the segmentation: one entry a cell.
struct PartMemory {
  View<Part> parts;
  View<int32_t> queue;
  ImageView<uint8_t> border;  ///< cells on a bend
  ImageView<uint8_t> scratch;
};

/// Marks the cells of rows [first_row, last_row) that lie on a concave bend: memory.border.
void find_bends(const CellGrid& cells, const PartMemory& memory, const MaskParams& params, int32_t first_row,
                int32_t last_row);

/// Fills cells.part: connected cells without a jump in depth or a concave bend (find_bends) between them have
/// the same number.
/// @return number of parts                                              test: parts_test
int32_t segment(const CellGrid& cells, const PartMemory& memory, const DepthNoise& noise);

/// Visits the cells of part number `i`.
template <class F>
void for_cells_of(const CellGrid& cells, int32_t i, const Part& part, const F& f) {
  for (int32_t r = part.row0; r < part.row1; ++r)
    for (int32_t c = part.col0; c < part.col1; ++c)
      if (cells.part.at(r, c) == i) f(r, c);
}

/// Whether it lies off so little that the map itself may not fit, and only what it did since it was seen
/// before can tell whether it moved (measure_slides).
bool needs_slide(const Part& part, const CellGrid& cells, const MaskParams& params, float usual);

/// How far the surface of a part may seem to lie off its place.
inline float may_move_m(const Part& part, const MaskParams& params) {
  return params.moved_m + params.moved_sigmas * part.noise_m;
}

/// Adds up evidence and least squares of each part.                    test: parts_test
void gather_parts(const CellGrid& cells, int32_t parts, const PartMemory& memory, const DepthNoise& noise);

/// The motion that most of the *space* agrees on: movers may fill the picture, but not the room. Parts that
/// follow another motion lose their vote; fills Part::moved_m.           test: parts_test
/// @return increment of the pose about the camera centre (see TrackPass), zero when it cannot be told
/// @param usual >= 1: how many times farther than expected the parts of a still picture lie off with this
/// sensor; learned: follows the median up at once, and down in seconds
Twistd agree_on_motion(int32_t parts, const PartMemory& memory, const MaskParams& params, float& usual);

/// Fills cells.dynamic from evidence, expectation and parts.             test: parts_test
void decide_parts(const CellGrid& cells, int32_t parts, const PartMemory& memory, const MaskParams& params,
                  float usual);

/// Carries the dynamic cells of the last frame into this one: fills now.expected.    test: parts_test
/// @param before last frame's grid (depth and dynamic are read); @param T_now_before its camera to this one's
void carry_mask(const ImageView<const float>& depth_before_m, const ImageView<const uint8_t>& dynamic_before,
                const Se3& T_now_before, const CellGrid& now);

}  // namespace stillmap
