#include "runtime/picture/image.hpp"

#include <cairo.h>

#include <array>
#include <cstring>
#include <fstream>
#include <memory>

#include <fmt/format.h>

namespace stillmap {
namespace {

constexpr uint64_t kMaxPixels = 64'000'000;

struct DestroySurface {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};

/// Looks at the header only, so that a lie about the size costs no memory.
Result<Done> check_header(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return Error{fmt::format("{}: cannot be opened; expected a PNG", path)};
  std::array<unsigned char, 24> head{};
  if (!file.read(reinterpret_cast<char*>(head.data()), head.size()) ||
      std::memcmp(head.data(), "\x89PNG\r\n\x1a\n", 8) != 0)
    return Error{fmt::format("{}: is no PNG", path)};
  const auto number = [&](std::size_t at) {
    return uint64_t{head[at]} << 24 | uint64_t{head[at + 1]} << 16 | uint64_t{head[at + 2]} << 8 |
           uint64_t{head[at + 3]};
  };
  const uint64_t width = number(16), height = number(20);
  if (width == 0 || height == 0 || width > 32767 || height > 32767 || width * height > kMaxPixels)
    return Error{fmt::format("{}: {} x {} pixels; at most 64 million are read", path, width, height)};
  return Done{};
}

}  // namespace

Picture::Picture(int32_t width_px, int32_t height_px, Rgb8 fill)
    : width(width_px),
      height(height_px),
      pixels(static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px), fill) {}

Result<Picture> read_picture(const std::string& path) {
  const Result<Done> header = check_header(path);
  if (!header) return Error{header.error()};
  const std::unique_ptr<cairo_surface_t, DestroySurface> surface(
      cairo_image_surface_create_from_png(path.c_str()));
  const cairo_status_t status = cairo_surface_status(surface.get());
  const cairo_format_t format = cairo_image_surface_get_format(surface.get());
  if (status != CAIRO_STATUS_SUCCESS || (format != CAIRO_FORMAT_RGB24 && format != CAIRO_FORMAT_ARGB32))
    return Error{
        fmt::format("{}: is no whole PNG of 8 bits: {}", path,
                    status == CAIRO_STATUS_SUCCESS ? "other depth" : cairo_status_to_string(status))};
  const int width = cairo_image_surface_get_width(surface.get());
  const int height = cairo_image_surface_get_height(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  Picture picture(width, height, {});
  for (int row = 0; row < height; ++row)
    for (int col = 0; col < width; ++col) {
      uint32_t pixel = 0;
      std::memcpy(&pixel, data + std::ptrdiff_t{row} * stride + std::ptrdiff_t{col} * 4, 4);
      picture.at(row, col) = {static_cast<uint8_t>(pixel >> 16), static_cast<uint8_t>(pixel >> 8),
                              static_cast<uint8_t>(pixel)};
    }
  return picture;
}

}  // namespace stillmap
