#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/view.hpp"

namespace stillmap::test {

/// An image that owns its pixels; `margin` columns behind each row must stay untouched.
template <class Pixel>
class TestImage {
 public:
  TestImage(int32_t rows, int32_t cols, int32_t margin = 0)
      : rows_(rows),
        cols_(cols),
        pitch_(cols + margin),
        pixels_(static_cast<size_t>(rows * (cols + margin))) {}

  ImageView<Pixel> view() { return {pixels_.data(), rows_, cols_, pitch_}; }
  ImageView<const Pixel> view() const { return {pixels_.data(), rows_, cols_, pitch_}; }

 private:
  int32_t rows_, cols_, pitch_;
  std::vector<Pixel> pixels_;
};

/// Depth that differs from pixel to pixel and uses both bytes; 0 and 65535 are there too.
inline TestImage<uint16_t> depth_pattern(int32_t rows, int32_t cols, uint32_t seed = 1) {
  TestImage<uint16_t> image(rows, cols);
  for (int32_t r = 0; r < rows; ++r)
    for (int32_t c = 0; c < cols; ++c)
      image.view().at(r, c) =
          static_cast<uint16_t>((static_cast<uint32_t>(r * 251 + c * 7) + seed * 9973) & 0xffff);
  image.view().at(0, 0) = 0;
  image.view().at(rows - 1, cols - 1) = 65535;
  return image;
}

inline TestImage<Rgb8> colour_pattern(int32_t rows, int32_t cols, uint32_t seed = 1) {
  TestImage<Rgb8> image(rows, cols);
  for (int32_t r = 0; r < rows; ++r)
    for (int32_t c = 0; c < cols; ++c)
      image.view().at(r, c) = {static_cast<uint8_t>(r * 5 + static_cast<int32_t>(seed)),
                               static_cast<uint8_t>(c * 3), static_cast<uint8_t>(r + c)};
  return image;
}

}  // namespace stillmap::test
