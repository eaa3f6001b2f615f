#include "runtime/picture/plot.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace stillmap {
namespace {

TEST(Ticks, AreRoundAndInside) {
  EXPECT_EQ(ticks({0, 10}, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  const std::vector<double> values = ticks({-0.37, 0.41}, 4);
  ASSERT_EQ(values.size(), 4u);
  EXPECT_NEAR(values[0], -0.2, 1e-12);
  EXPECT_NEAR(values[3], 0.4, 1e-12);
  EXPECT_TRUE(ticks({1, 1}, 5).empty());
  EXPECT_TRUE(ticks({0, INFINITY}, 5).empty());
  EXPECT_TRUE(ticks({NAN, 1}, 5).empty());
}

TEST(Plot, PutsValuesWhereTheAxesSay) {
  Canvas canvas(400, 300);
  Plot plot(canvas, {0, 0, 400, 300}, {0, 10}, {-1, 1}, {"t", "x", "y"});
  const Rect inner = plot.inner();
  EXPECT_NEAR(plot.to_page(Point{0, -1}).x, inner.x, 1e-9);
  EXPECT_NEAR(plot.to_page(Point{0, -1}).y, inner.y + inner.height, 1e-9);
  EXPECT_NEAR(plot.to_page(Point{5, 0}).x, inner.x + inner.width / 2, 1e-9);
  EXPECT_NEAR(plot.to_page(Point{10, 1}).y, inner.y, 1e-9);
}

TEST(Plot, AxesWithoutExtentGetOne) {
  Canvas canvas(400, 300);
  Plot plot(canvas, {0, 0, 400, 300}, {3, 3}, {1.3e9, 1.3e9}, {"t", "x", "y"});
  const Rect inner = plot.inner();
  EXPECT_NEAR(plot.to_page(Point{3, 1.3e9}).x, inner.x + inner.width / 2, 1e-6);
  EXPECT_NEAR(plot.to_page(Point{3, 1.3e9}).y, inner.y + inner.height / 2, 1e-6);
}

TEST(Plot, EqualScalesMakeAMetreAsLongBothWays) {
  const Rect outer = {0, 0, 700, 400};
  Range x = {0, 1}, y = {0, 5};
  Plot::make_equal(outer, x, y);
  EXPECT_LT(y.low, 0);
  EXPECT_GT(y.high, 5);
  Canvas canvas(700, 400);
  Plot plot(canvas, outer, x, y, {"t", "x", "y"});
  const double metre_x = plot.to_page(Point{1, 0}).x - plot.to_page(Point{0, 0}).x;
  const double metre_y = plot.to_page(Point{0, 0}).y - plot.to_page(Point{0, 1}).y;
  EXPECT_NEAR(metre_x, metre_y, 1e-9);
}

TEST(Thinned, KeepsExtremesAndEnds) {
  std::vector<Point> few = {{0, 1}, {0.1, 2}, {0.2, 3}};
  EXPECT_EQ(thinned(few).size(), 3u);
  std::vector<Point> many;
  for (int i = 0; i < 100'000; ++i)
    many.push_back({i * 0.01, i == 54'321 ? 77.0 : i == 54'322 ? -33.0 : (i % 7) * 0.1});
  const std::vector<Point> some = thinned(many);
  EXPECT_LE(some.size(), 4100u);
  EXPECT_EQ(some.front().x, many.front().x);
  EXPECT_EQ(some.back().x, many.back().x);
  const auto is = [](double y) { return [y](const Point& p) { return p.y == y; }; };
  EXPECT_EQ(std::count_if(some.begin(), some.end(), is(77.0)), 1);
  EXPECT_EQ(std::count_if(some.begin(), some.end(), is(-33.0)), 1);
  for (std::size_t i = 1; i < some.size(); ++i) ASSERT_GE(some[i].x, some[i - 1].x);
}

}  // namespace
}  // namespace stillmap
