#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "runtime/picture/canvas.hpp"

namespace stillmap {

/// Values along an axis.
struct Range {
  double low = 0, high = 1;

  double span() const { return high - low; }
};

/// Smallest range that holds all values; 0..1 when there are none.
Range range_of(const std::vector<double>& values);

/// Round numbers inside the range, about `count` of them.                 test: plot_test
std::vector<double> ticks(Range range, int count);

struct PlotLabels {
  std::string title, x, y;
};

/// Fewer points of a line on the page that look the same: of each stretch inside one column of pixels its
/// first and last, its lowest and highest.                                         test: plot_test
std::vector<Point> thinned(const std::vector<Point>& points);

enum class Mark : uint8_t { line, dashed, box, dot };

/// One name of a legend with its mark before it.
struct LegendItem {
  std::string name;
  Colour colour;
  Mark mark = Mark::line;
};

/// Axes with ticks, grid and labels in a part of the page; lines in the units of the axes.
class Plot {
 public:
  /// Draws grid and labels. @param outer the plot with its labels
  Plot(Canvas& canvas, const Rect& outer, Range x, Range y, const PlotLabels& labels);

  /// The same scale in both directions: widens one range so that a metre is as long in x as in y.
  static void make_equal(const Rect& outer, Range& x, Range& y);

  void line(const std::vector<Point>& values, Colour colour, double width_px = 2, bool dashed = false);
  /// Between two curves with the same x.
  void area(const std::vector<Point>& low, const std::vector<Point>& high, Colour colour);
  /// From bottom to top.
  void shade(Range x, Colour colour);
  void dot(Point value, double radius_px, Colour colour);
  /// Inside, in the corner where it hides the fewest of the points `avoid` (in the units of the axes).
  void legend(const std::vector<LegendItem>& items, const std::vector<Point>& avoid = {});
  /// In a row above the axes, where the title would stand.
  void legend_above(const std::vector<LegendItem>& items);

  Point to_page(Point value) const;
  const Rect& inner() const { return inner_; }

 private:
  static Rect inner_of(const Rect& outer);
  std::vector<Point> to_page(const std::vector<Point>& values) const;
  void draw_mark(const LegendItem& item, Point at);
  void draw_axes(const PlotLabels& labels, const Rect& outer);

  Canvas& canvas_;
  Rect inner_;
  Range x_, y_;
};

}  // namespace stillmap
