#pragma once

#include <cstdint>
#include <vector>

#include "runtime/ports/frame_source.hpp"

namespace stillmap::test {

/// Memory of one frame; rows are `margin` elements longer than the image.
struct FrameMemory {
  static constexpr uint16_t kUntouchedDepth = 0xabcd;  ///< before a source writes; no scene is so deep
  static constexpr uint8_t kUntouchedMask = 7;

  FrameMemory(int32_t cols, int32_t rows, int32_t margin = 0)
      : depth(static_cast<size_t>((cols + margin) * rows), kUntouchedDepth),
        colour(depth.size()),
        mask(depth.size(), kUntouchedMask) {
    frame.depth_raw = {depth.data(), rows, cols, cols + margin};
    frame.colour = {colour.data(), rows, cols, cols + margin};
    frame.truth_mask = {mask.data(), rows, cols, cols + margin};
  }
  explicit FrameMemory(const SourceInfo& info) : FrameMemory(info.camera.k.width, info.camera.k.height) {
    if (!info.has_truth_mask) frame.truth_mask = {};
  }
  FrameMemory(FrameMemory&&) = default;  // a copy would look at the pixels of the original
  FrameMemory& operator=(FrameMemory&&) = default;

  std::vector<uint16_t> depth;
  std::vector<Rgb8> colour;
  std::vector<uint8_t> mask;
  RgbdFrame frame;
};

}  // namespace stillmap::test
