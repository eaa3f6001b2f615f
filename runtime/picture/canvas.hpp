#pragma once

// Lines, text and images on a white page: a thin face of cairo.

#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "runtime/picture/image.hpp"

struct _cairo;
struct _cairo_surface;

namespace stillmap {

struct Colour {
  double r = 0, g = 0, b = 0, a = 1;  ///< 0..1
};

inline constexpr Colour kInk = {0.15, 0.15, 0.17, 1};
inline constexpr Colour kGrid = {0.88, 0.88, 0.90, 1};
inline constexpr Colour kTruthColour = {0.25, 0.25, 0.25, 1};
inline constexpr Colour kEstimateColour = {0.10, 0.40, 0.85, 1};
inline constexpr Colour kAccent = {0.90, 0.35, 0.10, 1};
inline constexpr Colour kPoorColour = {1.0, 0.80, 0.20, 0.45};
inline constexpr Colour kLostColour = {0.90, 0.10, 0.10, 0.35};

/// Pixels, from the top left.
struct Point {
  double x = 0, y = 0;
};
struct Rect {
  double x = 0, y = 0, width = 0, height = 0;
};

enum class Align { left, centre, right };

struct TextStyle {
  double size_px = 15;
  Align align = Align::left;
  bool bold = false;
  bool upright = false;  ///< turned to read from below
  Colour colour = kInk;
};

class Canvas {
 public:
  Canvas(int width_px, int height_px);

  /// `at`: end of the baseline that `align` names.
  void text(Point at, const std::string& words, const TextStyle& style = {});
  /// Width in pixels of plain words.
  double text_width(const std::string& words, double size_px);
  void fill(const Rect& rect, Colour colour);
  void outline(const Rect& rect, Colour colour, double width_px = 1);
  /// An area between a closed run of points.
  void polygon(const std::vector<Point>& points, Colour colour);
  void line(const std::vector<Point>& points, Colour colour, double width_px, bool dashed = false);
  void dot(Point at, double radius_px, Colour colour);
  /// Scaled into `rect`.
  void image(const Picture& picture, const Rect& rect);
  /// What follows is drawn inside `rect` only, until `unclip`.
  void clip(const Rect& rect);
  void unclip();

  int width() const { return width_; }
  int height() const { return height_; }

  /// Written aside and renamed.
  Result<Done> write_png(const std::string& path) const;

 private:
  struct Destroy {
    void operator()(_cairo* context) const;
    void operator()(_cairo_surface* surface) const;
  };
  void use(Colour colour);
  void trace(const std::vector<Point>& points, std::size_t begin, std::size_t end);

  int width_, height_;
  std::unique_ptr<_cairo_surface, Destroy> surface_;
  std::unique_ptr<_cairo, Destroy> context_;
};

}  // namespace stillmap
