#include "drivers/v4l2/pixel_format.hpp"

#include <iterator>

namespace stillmap {

FormatList formats_of(ImageKind kind) {
  static constexpr uint32_t kDepth[] = {kZ16, kY16};
  static constexpr uint32_t kColour[] = {kYuyv, kRgb24, kMjpeg, kJpeg, kGrey};
  if (kind == ImageKind::depth) return {kDepth, std::size(kDepth)};
  return {kColour, std::size(kColour)};
}

std::string fourcc_text(uint32_t format) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char c = static_cast<char>(format >> shift & 0x7f);
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

}  // namespace stillmap
