#pragma once

#include <cstdint>
#include <type_traits>

#include "kernels/base/hd.hpp"

namespace stillmap {

/// Non-owning run of elements; trivially copyable, passed by value to kernels, never stored past the call.
template <class T>
struct View {
  T* data = nullptr;
  uint32_t size = 0;

  STILLMAP_HD T& operator[](uint32_t i) const { return data[i]; }
  STILLMAP_HD T* begin() const { return data; }
  STILLMAP_HD T* end() const { return data + size; }
};

/// Non-owning image, rows x cols, row-major, `pitch` in elements.
template <class T>
struct ImageView {
  T* data = nullptr;
  int32_t rows = 0;
  int32_t cols = 0;
  int32_t pitch = 0;

  STILLMAP_HD T& at(int32_t row, int32_t col) const { return data[row * pitch + col]; }
  STILLMAP_HD T* row(int32_t r) const { return data + r * pitch; }
  STILLMAP_HD int32_t pixels() const { return rows * cols; }
  STILLMAP_HD bool contains(int32_t r, int32_t c) const { return r >= 0 && r < rows && c >= 0 && c < cols; }
  /// A view that may be written converts to one that may only be read.
  STILLMAP_HD operator ImageView<const T>() const { return {data, rows, cols, pitch}; }  // NOLINT
};

/// sRGB colour as it comes from the camera, 0..255 each.
struct Rgb8 {
  uint8_t r = 0, g = 0, b = 0;
};

static_assert(std::is_trivially_copyable_v<ImageView<float>>);
static_assert(sizeof(Rgb8) == 3);

}  // namespace stillmap
