#include "runtime/picture/canvas.hpp"

#include <cairo.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

namespace stillmap {
namespace {

constexpr const char* kFont = "DejaVu Sans";
constexpr std::size_t kMaxPathPoints = 400;

cairo_surface_t* surface_from(const Picture& picture) {
  cairo_surface_t* surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, picture.width, picture.height);
  if (cairo_surface_status(surface) != CAIRO_STATUS_SUCCESS) return surface;
  cairo_surface_flush(surface);
  unsigned char* data = cairo_image_surface_get_data(surface);
  const std::ptrdiff_t stride = cairo_image_surface_get_stride(surface);
  for (int32_t row = 0; row < picture.height; ++row)
    for (int32_t col = 0; col < picture.width; ++col) {
      const Rgb8 p = picture.at(row, col);
      const uint32_t pixel = uint32_t{p.r} << 16 | uint32_t{p.g} << 8 | uint32_t{p.b};
      std::memcpy(data + row * stride + std::ptrdiff_t{col} * 4, &pixel, 4);
    }
  cairo_surface_mark_dirty(surface);
  return surface;
}

}  // namespace

void Canvas::Destroy::operator()(_cairo* context) const {
  cairo_destroy(context);
}
void Canvas::Destroy::operator()(_cairo_surface* surface) const {
  cairo_surface_destroy(surface);
}

Canvas::Canvas(int width_px, int height_px)
    : width_(width_px),
      height_(height_px),
      surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width_px, height_px)),
      context_(cairo_create(surface_.get())) {
  fill({0, 0, static_cast<double>(width_px), static_cast<double>(height_px)}, {1, 1, 1, 1});
  cairo_set_line_join(context_.get(), CAIRO_LINE_JOIN_ROUND);
}

void Canvas::use(Colour colour) {
  cairo_set_source_rgba(context_.get(), colour.r, colour.g, colour.b, colour.a);
}

void Canvas::trace(const std::vector<Point>& points, std::size_t begin, std::size_t end) {
  cairo_new_path(context_.get());
  for (std::size_t i = begin; i < end; ++i) cairo_line_to(context_.get(), points[i].x, points[i].y);
}

void Canvas::text(Point at, const std::string& words, const TextStyle& style) {
  cairo_t* context = context_.get();
  cairo_save(context);
  cairo_select_font_face(context, kFont, CAIRO_FONT_SLANT_NORMAL,
                         style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context, style.size_px);
  cairo_text_extents_t extents;
  cairo_text_extents(context, words.c_str(), &extents);
  const double shift = style.align == Align::left     ? 0
                       : style.align == Align::centre ? -extents.x_advance / 2
                                                      : -extents.x_advance;
  cairo_translate(context, at.x, at.y);
  if (style.upright) cairo_rotate(context, -1.5707963267948966);
  cairo_move_to(context, shift, 0);
  use(style.colour);
  cairo_show_text(context, words.c_str());
  cairo_restore(context);
}

double Canvas::text_width(const std::string& words, double size_px) {
  cairo_select_font_face(context_.get(), kFont, CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), size_px);
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), words.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::fill(const Rect& rect, Colour colour) {
  use(colour);
  cairo_rectangle(context_.get(), rect.x, rect.y, rect.width, rect.height);
  cairo_fill(context_.get());
}

void Canvas::outline(const Rect& rect, Colour colour, double width_px) {
  use(colour);
  cairo_set_line_width(context_.get(), width_px);
  cairo_rectangle(context_.get(), rect.x, rect.y, rect.width, rect.height);
  cairo_stroke(context_.get());
}

void Canvas::polygon(const std::vector<Point>& points, Colour colour) {
  use(colour);
  trace(points, 0, points.size());
  cairo_fill(context_.get());
}

void Canvas::line(const std::vector<Point>& points, Colour colour, double width_px, bool dashed) {
  use(colour);
  cairo_set_line_width(context_.get(), width_px);
  const double dashes[] = {8, 5};
  cairo_set_dash(context_.get(), dashes, dashed ? 2 : 0, 0);
  // In pieces: cairo's time grows faster than the number of points that cross each other in one path.
  std::size_t begin = 0;
  do {
    const std::size_t end = std::min(begin + kMaxPathPoints, points.size());
    trace(points, begin, end);
    cairo_stroke(context_.get());
    begin = end - (end > 0 ? 1 : 0);
  } while (begin + 1 < points.size());
  cairo_set_dash(context_.get(), nullptr, 0, 0);
}

void Canvas::dot(Point at, double radius_px, Colour colour) {
  use(colour);
  cairo_new_path(context_.get());
  cairo_arc(context_.get(), at.x, at.y, radius_px, 0, 6.283185307179586);
  cairo_fill(context_.get());
}

void Canvas::image(const Picture& picture, const Rect& rect) {
  if (picture.width == 0 || picture.height == 0) return;
  const std::unique_ptr<cairo_surface_t, Destroy> source(surface_from(picture));
  cairo_t* context = context_.get();
  cairo_save(context);
  cairo_rectangle(context, rect.x, rect.y, rect.width, rect.height);
  cairo_clip(context);
  cairo_translate(context, rect.x, rect.y);
  cairo_scale(context, rect.width / picture.width, rect.height / picture.height);
  cairo_set_source_surface(context, source.get(), 0, 0);
  cairo_pattern_set_filter(cairo_get_source(context), CAIRO_FILTER_GOOD);
  cairo_pattern_set_extend(cairo_get_source(context), CAIRO_EXTEND_PAD);
  cairo_paint(context);
  cairo_restore(context);
}

void Canvas::clip(const Rect& rect) {
  cairo_save(context_.get());
  cairo_rectangle(context_.get(), rect.x, rect.y, rect.width, rect.height);
  cairo_clip(context_.get());
}

void Canvas::unclip() {
  cairo_restore(context_.get());
}

Result<Done> Canvas::write_png(const std::string& path) const {
  const std::string part = path + ".part";
  cairo_surface_flush(surface_.get());
  errno = 0;
  cairo_status_t status = cairo_status(context_.get());
  if (status == CAIRO_STATUS_SUCCESS) status = cairo_surface_write_to_png(surface_.get(), part.c_str());
  if (status == CAIRO_STATUS_SUCCESS && std::rename(part.c_str(), path.c_str()) == 0) return Done{};
  const char* reason = errno != 0 ? std::strerror(errno) : cairo_status_to_string(status);
  const Error error{fmt::format("{}: cannot be written: {}", path, reason)};
  std::remove(part.c_str());
  return error;
}

}  // namespace stillmap
