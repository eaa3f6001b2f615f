#pragma once

// Image files in and out. Images are at most 8192 pixels wide and high, files at most 64 MiB.

#include <cstdint>
#include <string>

#include "config/result.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

inline constexpr int32_t kMaxImageSide = 8192;
inline constexpr uint64_t kMaxImageBytes = 64 << 20;

/// What the head of an image file says.
struct ImageInfo {
  int32_t rows = 0, cols = 0;
  int32_t bits = 8;   ///< of one channel
  bool grey = false;  ///< a single channel
};

/// Looks at the head of a PNG or JPEG file, told apart by their first bytes.
/// @return one line naming the file and what is wrong with it
/// @thread any; not the real-time thread
Result<ImageInfo> image_info(const std::string& path);

/// Reads a 16-bit grey PNG (raw depth) of exactly the size of `out`. After an error `out` holds anything.
/// @return one line naming file, expected and found
/// @thread any; not the real-time thread
Result<Done> read_png16(const std::string& path, ImageView<uint16_t> out);

/// Reads a JPEG or an 8-bit PNG (grey, RGB, palette; alpha is let go) of exactly the size of `out`.
/// After an error `out` holds anything.
Result<Done> read_colour(const std::string& path, ImageView<Rgb8> out);

/// The writers write PATH.part and rename it, so that PATH is always a whole image.
/// @return one line naming the file and the system's reason
Result<Done> write_png(const std::string& path, ImageView<const Rgb8> image);
Result<Done> write_png_grey(const std::string& path, ImageView<const uint8_t> image);
Result<Done> write_png16(const std::string& path, ImageView<const uint16_t> image);

}  // namespace stillmap
