#pragma once

// Recordings of a few small frames, written for one test.

#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "runtime/image/image_file.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap::test {

inline constexpr int32_t kTinyRows = 12, kTinyCols = 16;
inline constexpr const char* kTinyCamera = "fx = 20.0\nfy = 21.0\ncx = 8.0\ncy = 6.0\n";

inline void write_depth(const std::string& path, uint32_t seed = 1) {
  const Result<Done> done = write_png16(path, depth_pattern(kTinyRows, kTinyCols, seed).view());
  ASSERT_TRUE(done) << done.error();
}

inline void write_colour(const std::string& path, uint32_t seed = 1) {
  const Result<Done> done = write_png(path, colour_pattern(kTinyRows, kTinyCols, seed).view());
  ASSERT_TRUE(done) << done.error();
}

/// `count` frames in the layout of TUM, stamps `1.0, 1.1, ...`; no list of them yet.
inline void write_tum_images(const TempDir& dir, int count) {
  for (int i = 0; i < count; ++i) {
    const std::string name = std::to_string(i) + ".png";
    write_depth(dir / ("depth/" + name), static_cast<uint32_t>(i));
    write_colour(dir / ("rgb/" + name), static_cast<uint32_t>(i));
  }
}

/// `frame-NNNNNN.` and the ending.
inline std::string sevenscenes_name(int number, const std::string& ending) {
  char name[32];
  std::snprintf(name, sizeof name, "frame-%06d.", number);
  return name + ending;
}

inline void write_sevenscenes_frame(const TempDir& dir, int number) {
  write_depth(dir / sevenscenes_name(number, "depth.png"), static_cast<uint32_t>(number));
  write_colour(dir / sevenscenes_name(number, "color.png"), static_cast<uint32_t>(number));
}

}  // namespace stillmap::test
