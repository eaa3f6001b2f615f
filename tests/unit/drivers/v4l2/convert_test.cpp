#include "drivers/v4l2/convert.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr uint8_t kUntouched = 0xcd;

/// Memory of an image whose rows are followed by three pixels that nobody may write.
template <class T>
struct Padded {
  static constexpr int32_t kMargin = 3;
  Padded(int32_t cols, int32_t rows) : memory(static_cast<size_t>((cols + kMargin) * rows)) {
    std::memset(static_cast<void*>(memory.data()), kUntouched, memory.size() * sizeof(T));
    view = {memory.data(), rows, cols, cols + kMargin};
  }
  void expect_margin_untouched() const {
    const auto* const bytes = reinterpret_cast<const uint8_t*>(memory.data());
    for (int32_t row = 0; row < view.rows; ++row)
      for (size_t i = static_cast<size_t>(view.cols) * sizeof(T);
           i < static_cast<size_t>(view.pitch) * sizeof(T); ++i)
        ASSERT_EQ(bytes[static_cast<size_t>(row * view.pitch) * sizeof(T) + i], kUntouched) << "row " << row;
  }
  std::vector<T> memory;
  ImageView<T> view;
};

int exact(double value) {
  return static_cast<int>(std::lround(std::clamp(value, 0.0, 255.0)));
}

TEST(V4l2Convert, YuyvIsWithinOneOfTheStandard) {
  constexpr int32_t kCols = 258;  // two whole chunks of pairs and one pair
  int worst = 0;
  for (int u = 0; u < 256; u += 5)
    for (int v = 0; v < 256; v += 5) {
      std::vector<uint8_t> yuyv(2 * kCols);
      for (int32_t col = 0; col < kCols; ++col) {
        yuyv[static_cast<size_t>(2 * col)] = static_cast<uint8_t>(col);
        yuyv[static_cast<size_t>(2 * col + 1)] = static_cast<uint8_t>(col % 2 == 0 ? u : v);
      }
      Padded<Rgb8> rgb(kCols, 1);
      yuyv_to_rgb({yuyv.data(), 2 * kCols}, rgb.view);
      for (int32_t col = 0; col < kCols; ++col) {
        const double y = 255.0 / 219 * (yuyv[static_cast<size_t>(2 * col)] - 16);
        const double cb = 255.0 / 224 * (u - 128), cr = 255.0 / 224 * (v - 128);
        const Rgb8 is = rgb.view.at(0, col);
        worst = std::max({worst, std::abs(is.r - exact(y + 1.402 * cr)),
                          std::abs(is.g - exact(y - 0.344136 * cb - 0.714136 * cr)),
                          std::abs(is.b - exact(y + 1.772 * cb))});
      }
      rgb.expect_margin_untouched();
    }
  EXPECT_LE(worst, 1);
}

TEST(V4l2Convert, EveryWidthOfYuyvIsWhole) {
  for (int32_t cols = 2; cols <= 300; cols += 2) {
    const std::vector<uint8_t> white = [&] {
      std::vector<uint8_t> bytes(static_cast<size_t>(2 * cols * 2), 128);
      for (size_t i = 0; i < bytes.size(); i += 2) bytes[i] = 235;
      return bytes;
    }();
    Padded<Rgb8> rgb(cols, 2);
    yuyv_to_rgb({white.data(), static_cast<uint32_t>(2 * cols)}, rgb.view);
    for (int32_t row = 0; row < 2; ++row)
      for (int32_t col = 0; col < cols; ++col) ASSERT_GE(rgb.view.at(row, col).g, 254) << cols << " " << col;
    rgb.expect_margin_untouched();
  }
}

TEST(V4l2Convert, RowsAreFoundByTheirPitch) {
  // 2 columns, 2 rows, 4 bytes of padding: bytes count up.
  std::vector<uint8_t> bytes(64);
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(i);
  Padded<uint16_t> depth(2, 2);
  copy_depth({bytes.data(), 8}, depth.view);
  EXPECT_EQ(depth.view.at(0, 0), 0x0100);
  EXPECT_EQ(depth.view.at(0, 1), 0x0302);
  EXPECT_EQ(depth.view.at(1, 0), 0x0908);
  depth.expect_margin_untouched();
  Padded<Rgb8> rgb(2, 2);
  copy_rgb({bytes.data(), 10}, rgb.view);
  EXPECT_EQ(rgb.view.at(0, 1).b, 5);
  EXPECT_EQ(rgb.view.at(1, 0).r, 10);
  rgb.expect_margin_untouched();
  grey_to_rgb({bytes.data(), 6}, rgb.view);
  EXPECT_EQ(rgb.view.at(1, 1).r, 7);
  EXPECT_EQ(rgb.view.at(1, 1).g, 7);
  EXPECT_EQ(rgb.view.at(1, 1).b, 7);
  rgb.expect_margin_untouched();
  fill_mid_grey(rgb.view);
  EXPECT_EQ(rgb.view.at(1, 1).g, 128);
  EXPECT_EQ(rgb.view.at(0, 0).r, 128);
  rgb.expect_margin_untouched();
}

// Half a millisecond on a free processor; the bar is for one that others use as well.
TEST(V4l2Convert, AFrameTakesAMillisecondOrSo) {
  constexpr int32_t kCols = 640, kRows = 480;
  const std::vector<uint8_t> yuyv(2 * kCols * kRows, 90), z16(2 * kCols * kRows, 7);
  std::vector<Rgb8> rgb(kCols * kRows);
  std::vector<uint16_t> depth(kCols * kRows);
  double best_ms = 1e9;
  for (int i = 0; i < 100; ++i) {
    const auto start = std::chrono::steady_clock::now();
    copy_depth({z16.data(), 2 * kCols}, {depth.data(), kRows, kCols, kCols});
    yuyv_to_rgb({yuyv.data(), 2 * kCols}, {rgb.data(), kRows, kCols, kCols});
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    best_ms = std::min(best_ms, took.count());
  }
  RecordProperty("ms", std::to_string(best_ms));
  std::printf("YUYV + Z16 at 640x480: %.3f ms\n", best_ms);
  if (heap_guard::counts()) {  // a sanitizer is no measure
    EXPECT_LT(best_ms, 3);
  }
}

}  // namespace
}  // namespace stillmap
