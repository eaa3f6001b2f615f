#pragma once

#include <turbojpeg.h>

#include <cstdint>
#include <vector>

#include "kernels/base/view.hpp"

namespace stillmap::test {

/// A JPEG image of one colour.
inline std::vector<uint8_t> jpeg_image(int32_t cols, int32_t rows, Rgb8 colour) {
  const std::vector<Rgb8> pixels(static_cast<size_t>(cols * rows), colour);
  const tjhandle coder = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  tjCompress2(coder, reinterpret_cast<const unsigned char*>(pixels.data()), cols, 0, rows, TJPF_RGB, &bytes,
              &size, TJSAMP_422, 95, 0);
  std::vector<uint8_t> image(bytes, bytes + size);
  tjFree(bytes);
  tjDestroy(coder);
  return image;
}

}  // namespace stillmap::test
