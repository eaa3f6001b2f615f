#pragma once

#include <cstdint>
#include <string>

namespace stillmap {

/// The four characters by which V4L2 names how pixels lie in memory, the first in the lowest byte.
constexpr uint32_t fourcc(const char (&name)[5]) {
  const auto byte = [&](int i) { return static_cast<uint32_t>(static_cast<unsigned char>(name[i])); };
  return byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24;
}

inline constexpr uint32_t kZ16 = fourcc("Z16 ");    ///< depth, 16 bits
inline constexpr uint32_t kY16 = fourcc("Y16 ");    ///< as some cameras name their depth
inline constexpr uint32_t kYuyv = fourcc("YUYV");   ///< two pixels in four bytes, BT.601, 16..235
inline constexpr uint32_t kRgb24 = fourcc("RGB3");  ///< red first
inline constexpr uint32_t kGrey = fourcc("GREY");   ///< 8 bits
inline constexpr uint32_t kMjpeg = fourcc("MJPG");
inline constexpr uint32_t kJpeg = fourcc("JPEG");  ///< the same

enum class ImageKind : uint8_t { depth, colour };

/// What can be used of a kind, best first; compressed images cost a thread and come last but for grey ones.
struct FormatList {
  const uint32_t* begin_;
  uint32_t count;
  const uint32_t* begin() const { return begin_; }
  const uint32_t* end() const { return begin_ + count; }
};
FormatList formats_of(ImageKind kind);

/// Bytes of a pixel; 0: compressed.
constexpr uint32_t bytes_per_pixel(uint32_t format) {
  if (format == kMjpeg || format == kJpeg) return 0;
  return format == kRgb24 ? 3 : format == kGrey ? 1 : 2;
}

/// "YUYV"; what cannot be printed becomes '?'.
std::string fourcc_text(uint32_t format);

}  // namespace stillmap
