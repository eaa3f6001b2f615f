#pragma once

#include <cstdint>

#include "kernels/base/view.hpp"

namespace stillmap {

/// An image as it lies in a buffer of the kernel's.
struct RawImage {
  const uint8_t* data = nullptr;
  uint32_t pitch_bytes = 0;
};

// The one copy of an image, from the kernel's buffer into the frame. `to` has the size of the image; rows of
// `from` hold at least as many pixels. None of them allocates.   @thread any; test: convert_test

/// 16 bits a pixel, little endian.
void copy_depth(RawImage from, ImageView<uint16_t> to);
void copy_rgb(RawImage from, ImageView<Rgb8> to);
void grey_to_rgb(RawImage from, ImageView<Rgb8> to);
/// BT.601 with 16..235, as cameras send it; within 1 of the exact value. An even number of columns.
void yuyv_to_rgb(RawImage from, ImageView<Rgb8> to);
/// What stands for colour where there is none: an image without any gradient says nothing to the tracker.
void fill_mid_grey(ImageView<Rgb8> to);

}  // namespace stillmap
