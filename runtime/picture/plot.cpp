#include "runtime/picture/plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

namespace stillmap {
namespace {

constexpr double kLeft_px = 74, kRight_px = 18, kTop_px = 34, kBottom_px = 50;

double tick_step(Range range, int count) {
  const double raw = range.span() / std::max(count, 1);
  const double magnitude = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (raw <= factor * magnitude * 1.0001) return factor * magnitude;
  return 10 * magnitude;
}

std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(-std::floor(std::log10(step) + 1e-9)), 0, 9);
  return fmt::format("{:.{}f}", std::abs(value) < step * 1e-6 ? 0.0 : value, decimals);
}

}  // namespace

Range range_of(const std::vector<double>& values) {
  if (values.empty()) return {};
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {*low, *high};
}

std::vector<double> ticks(Range range, int count) {
  if (!(range.span() > 0) || !std::isfinite(range.span())) return {};
  const double step = tick_step(range, count);
  const double first = std::ceil(range.low / step - 1e-9);
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) {
    const double value = (first + i) * step;
    if (value > range.high + step * 1e-9) break;
    values.push_back(value);
  }
  return values;
}

Rect Plot::inner_of(const Rect& outer) {
  return {outer.x + kLeft_px, outer.y + kTop_px, outer.width - kLeft_px - kRight_px,
          outer.height - kTop_px - kBottom_px};
}

Plot::Plot(Canvas& canvas, const Rect& outer, Range x, Range y, const PlotLabels& labels)
    : canvas_(canvas), inner_(inner_of(outer)), x_(x), y_(y) {
  // An axis without extent gets one, relative to its value so that it survives the rounding of large numbers.
  for (Range* range : {&x_, &y_})
    if (!(range->span() > 1e-9 * std::max(1.0, std::abs(range->low)))) {
      const double half = 0.5 * std::max(1.0, 1e-6 * std::abs(range->low));
      *range = {range->low - half, range->low + half};
    }
  draw_axes(labels, outer);
}

void Plot::make_equal(const Rect& outer, Range& x, Range& y) {
  const Rect inner = inner_of(outer);
  const double margin = 1.08;
  const double metre_per_px =
      std::max({margin * x.span() / inner.width, margin * y.span() / inner.height, 1e-6});
  const auto widen = [&](Range& range, double px) {
    const double centre = 0.5 * (range.low + range.high), half = 0.5 * metre_per_px * px;
    range = {centre - half, centre + half};
  };
  widen(x, inner.width);
  widen(y, inner.height);
}

void Plot::draw_axes(const PlotLabels& labels, const Rect& outer) {
  const double bottom = inner_.y + inner_.height, right = inner_.x + inner_.width;
  const std::vector<double> x_ticks = ticks(x_, static_cast<int>(inner_.width / 90));
  const std::vector<double> y_ticks = ticks(y_, static_cast<int>(std::max(2.0, inner_.height / 45)));
  const double x_step = x_ticks.size() > 1 ? x_ticks[1] - x_ticks[0] : 1;
  const double y_step = y_ticks.size() > 1 ? y_ticks[1] - y_ticks[0] : 1;
  for (const double value : x_ticks) {
    const double at = to_page(Point{value, y_.low}).x;
    canvas_.line({{at, inner_.y}, {at, bottom}}, kGrid, 1);
    canvas_.text({at, bottom + 19}, tick_text(value, x_step), {14, Align::centre});
  }
  for (const double value : y_ticks) {
    const double at = to_page(Point{x_.low, value}).y;
    canvas_.line({{inner_.x, at}, {right, at}}, kGrid, 1);
    canvas_.text({inner_.x - 8, at + 5}, tick_text(value, y_step), {14, Align::right});
  }
  canvas_.outline(inner_, {0.55, 0.55, 0.58, 1}, 1);
  canvas_.text({inner_.x, outer.y + 22}, labels.title, {16, Align::left, true});
  canvas_.text({inner_.x + inner_.width / 2, bottom + 41}, labels.x, {15, Align::centre});
  TextStyle upright = {15, Align::centre};
  upright.upright = true;
  canvas_.text({outer.x + 20, inner_.y + inner_.height / 2}, labels.y, upright);
}

Point Plot::to_page(Point value) const {
  // Far outside is as good as outside; cairo's fixed point numbers end at 2^23.
  const double x = std::clamp((value.x - x_.low) / x_.span(), -20.0, 20.0);
  const double y = std::clamp((value.y - y_.low) / y_.span(), -20.0, 20.0);
  return {inner_.x + x * inner_.width, inner_.y + inner_.height - y * inner_.height};
}

std::vector<Point> Plot::to_page(const std::vector<Point>& values) const {
  std::vector<Point> points;
  points.reserve(values.size());
  for (const Point& value : values) points.push_back(to_page(value));
  return points;
}

std::vector<Point> thinned(const std::vector<Point>& points) {
  constexpr std::size_t kFew = 4000;
  if (points.size() <= kFew) return points;
  std::vector<Point> some;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= points.size(); ++i) {
    if (i < points.size() && std::floor(points[i].x) == std::floor(points[begin].x)) continue;
    // A run inside one column of pixels: where it begins, its extremes and where it ends say all of it.
    const auto from = points.begin() + static_cast<std::ptrdiff_t>(begin),
               to = points.begin() + static_cast<std::ptrdiff_t>(i);
    auto [low, high] =
        std::minmax_element(from, to, [](const Point& a, const Point& b) { return a.y < b.y; });
    if (high < low) std::swap(low, high);
    some.insert(some.end(), {*from, *low, *high, *(to - 1)});
    begin = i;
  }
  return some;
}

void Plot::line(const std::vector<Point>& values, Colour colour, double width_px, bool dashed) {
  canvas_.clip(inner_);
  canvas_.line(thinned(to_page(values)), colour, width_px, dashed);
  canvas_.unclip();
}

void Plot::area(const std::vector<Point>& low, const std::vector<Point>& high, Colour colour) {
  std::vector<Point> outline = to_page(low);
  const std::vector<Point> top = to_page(high);
  outline.insert(outline.end(), top.rbegin(), top.rend());
  canvas_.clip(inner_);
  canvas_.polygon(outline, colour);
  canvas_.unclip();
}

void Plot::shade(Range x, Colour colour) {
  const double left = to_page(Point{x.low, 0}).x, right = to_page(Point{x.high, 0}).x;
  canvas_.clip(inner_);
  canvas_.fill({left, inner_.y, std::max(right - left, 1.0), inner_.height}, colour);
  canvas_.unclip();
}

void Plot::dot(Point value, double radius_px, Colour colour) {
  canvas_.dot(to_page(value), radius_px, colour);
}

void Plot::draw_mark(const LegendItem& item, Point at) {
  if (item.mark == Mark::box) canvas_.fill({at.x, at.y - 6, 26, 12}, item.colour);
  if (item.mark == Mark::dot) canvas_.dot({at.x + 13, at.y}, 5, item.colour);
  if (item.mark == Mark::line || item.mark == Mark::dashed)
    canvas_.line({{at.x, at.y}, {at.x + 26, at.y}}, item.colour, 3, item.mark == Mark::dashed);
  canvas_.text({at.x + 34, at.y + 5}, item.name, {14});
}

void Plot::legend(const std::vector<LegendItem>& items, const std::vector<Point>& avoid) {
  constexpr double kLine_px = 22, kMargin_px = 8;
  double widest = 0;
  for (const LegendItem& item : items) widest = std::max(widest, canvas_.text_width(item.name, 14));
  const double width = 54 + widest;
  const double height = 10 + kLine_px * static_cast<double>(items.size());
  const double left = inner_.x + kMargin_px, right = inner_.x + inner_.width - width - kMargin_px;
  const double top = inner_.y + kMargin_px, bottom = inner_.y + inner_.height - height - kMargin_px;
  const std::vector<Point> points = to_page(avoid);
  Rect box;
  std::ptrdiff_t fewest = PTRDIFF_MAX;
  for (const Point corner :
       {Point{right, top}, Point{left, top}, Point{right, bottom}, Point{left, bottom}}) {
    const auto hidden = std::count_if(points.begin(), points.end(), [&](Point p) {
      return p.x >= corner.x && p.x <= corner.x + width && p.y >= corner.y && p.y <= corner.y + height;
    });
    if (hidden >= fewest) continue;
    fewest = hidden;
    box = {corner.x, corner.y, width, height};
  }
  canvas_.fill(box, {1, 1, 1, 0.85});
  canvas_.outline(box, kGrid, 1);
  Point at = {box.x + 10, box.y + 5 + kLine_px / 2};
  for (const LegendItem& item : items) {
    draw_mark(item, at);
    at.y += kLine_px;
  }
}

void Plot::legend_above(const std::vector<LegendItem>& items) {
  Point at = {inner_.x, inner_.y - 16};
  for (const LegendItem& item : items) {
    draw_mark(item, at);
    at.x += 58 + canvas_.text_width(item.name, 14);
  }
}

}  // namespace stillmap
