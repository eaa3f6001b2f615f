#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

/// Pixels that a picture is made of; row-major, no padding.
struct Picture {
  int32_t width = 0, height = 0;
  std::vector<Rgb8> pixels;

  Picture() = default;
  Picture(int32_t width_px, int32_t height_px, Rgb8 fill);

  Rgb8& at(int32_t row, int32_t col) { return pixels[index(row, col)]; }
  Rgb8 at(int32_t row, int32_t col) const { return pixels[index(row, col)]; }

 private:
  std::size_t index(int32_t row, int32_t col) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(col);
  }
};

/// Reads a PNG of any kind (grey becomes r = g = b).
/// @return an error naming file and reason for what is no whole PNG or has more than 64 million pixels
Result<Picture> read_picture(const std::string& path);

}  // namespace stillmap
