#pragma once

// A keyframe outside the store: as it is saved. Plain bytes, little-endian:
//   PlaceRecordHead
//   a byte for each fern, as FernPass writes it

#include <cstdint>

#include "kernels/base/se3.hpp"

namespace stillmap {

struct PlaceRecordHead {
  Se3 T_map_cam;
  uint32_t ferns;      ///< bytes that follow
  int32_t rows, cols;  ///< of the small view that the ferns look at
};
static_assert(sizeof(PlaceRecordHead) == 60);

constexpr uint32_t kMaxPlaceRecordBytes = sizeof(PlaceRecordHead) + 4096;

}  // namespace stillmap
