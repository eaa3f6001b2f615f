#include "runtime/record/frame_coder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::contains;
using test::FrameMemory;

constexpr int32_t kCols = 64, kRows = 48;

/// A frame of noise, or of smooth patterns as cameras see them. @param margin elements behind each row
FrameMemory frame_of(uint32_t seed, bool noise, int32_t margin = 0) {
  FrameMemory memory(kCols, kRows, margin);
  std::mt19937 random(seed);
  const auto depth = test::depth_pattern(kRows, kCols, seed);
  const auto colour = test::colour_pattern(kRows, kCols, seed);
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      memory.frame.depth_raw.at(r, c) = noise ? static_cast<uint16_t>(random()) : depth.view().at(r, c);
      memory.frame.colour.at(r, c) =
          noise ? Rgb8{static_cast<uint8_t>(random()), static_cast<uint8_t>(random()),
                       static_cast<uint8_t>(random())}
                : colour.view().at(r, c);
    }
  memory.frame.depth_stamp = {123456789012345 + seed};
  memory.frame.colour_stamp = {-5};
  memory.frame.sequence = seed;
  return memory;
}

void expect_same_depth(const RgbdFrame& a, const RgbdFrame& b) {
  for (int32_t r = 0; r < kRows; ++r)
    ASSERT_EQ(std::memcmp(a.depth_raw.row(r), b.depth_raw.row(r), kCols * sizeof(uint16_t)), 0)
        << "row " << r;
}

TEST(FrameCoder, IsWithoutLoss) {
  FrameEncoder encoder(kRows, kCols, ImageCoding::zstd_colour);
  FrameDecoder decoder;
  for (uint32_t seed = 0; seed < 6; ++seed) {
    const FrameMemory frame = frame_of(seed, seed % 2 == 1, static_cast<int32_t>(seed % 3));
    FrameMessage message;
    ASSERT_EQ(encoder.encode(frame.frame, message), Status::ok);
    FrameMemory back(kCols, kRows, static_cast<int32_t>(seed % 2));
    ASSERT_EQ(decoder.decode(message, back.frame), Status::ok) << decoder.error();
    expect_same_depth(frame.frame, back.frame);
    for (int32_t r = 0; r < kRows; ++r)
      ASSERT_EQ(std::memcmp(frame.frame.colour.row(r), back.frame.colour.row(r), kCols * sizeof(Rgb8)), 0);
    EXPECT_EQ(back.frame.depth_stamp, frame.frame.depth_stamp);
    EXPECT_EQ(back.frame.colour_stamp, frame.frame.colour_stamp);
    EXPECT_EQ(back.frame.sequence, seed);
  }
}

TEST(FrameCoder, JpegKeepsDepthAndNearlyTheColour) {
  FrameEncoder encoder(kRows, kCols, ImageCoding::jpeg);
  FrameDecoder decoder;
  FrameMemory frame = frame_of(1, false);
  for (int32_t r = 0; r < kRows; ++r)  // smooth: JPEG is made for that
    for (int32_t c = 0; c < kCols; ++c) {
      const auto v = static_cast<uint8_t>(2 * r + c);
      frame.frame.colour.at(r, c) = {v, static_cast<uint8_t>(v + 20), static_cast<uint8_t>(v / 2)};
    }
  FrameMessage message;
  ASSERT_EQ(encoder.encode(frame.frame, message), Status::ok);
  FrameMemory back(kCols, kRows);
  ASSERT_EQ(decoder.decode(message, back.frame), Status::ok) << decoder.error();
  expect_same_depth(frame.frame, back.frame);
  int worst = 0;
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c)
      worst = std::max(worst, std::abs(frame.frame.colour.at(r, c).g - back.frame.colour.at(r, c).g));
  EXPECT_LE(worst, 8);
}

TEST(FrameCoder, RefusesFramesOfAnotherSize) {
  FrameEncoder encoder(kRows, kCols + 1, ImageCoding::zstd_colour);
  const FrameMemory frame = frame_of(0, false);
  FrameMessage message;
  EXPECT_EQ(encoder.encode(frame.frame, message), Status::bad_data);
}

TEST(FrameCoder, SeesEveryChangedByte) {
  FrameEncoder encoder(kRows, kCols, ImageCoding::zstd_colour);
  FrameDecoder decoder;
  const FrameMemory frame = frame_of(3, false);
  FrameMessage message;
  ASSERT_EQ(encoder.encode(frame.frame, message), Status::ok);
  std::vector<uint8_t> colour(message.colour.begin(), message.colour.end());
  for (size_t i = 0; i < colour.size(); i += 7) {
    colour[i] ^= 1;
    FrameMessage damaged = message;
    damaged.colour = {colour.data(), message.colour.size};
    FrameMemory back(kCols, kRows);
    ASSERT_EQ(decoder.decode(damaged, back.frame), Status::bad_data);
    ASSERT_TRUE(contains(decoder.error(), "checksum"));
    colour[i] ^= 1;
  }
  FrameMessage damaged = message;
  ++damaged.depth_stamp.ns;
  FrameMemory back(kCols, kRows);
  EXPECT_EQ(decoder.decode(damaged, back.frame), Status::bad_data) << "stamps are checked as well";
}

/// With a right checksum over wrong bytes, as a foreign or hostile program would write them.
TEST(FrameCoder, NoBytesMakeItCrash) {
  FrameDecoder decoder;
  std::mt19937 random(5);
  for (const ImageCoding coding : {ImageCoding::zstd_colour, ImageCoding::jpeg}) {
    FrameEncoder encoder(kRows, kCols, coding);
    const FrameMemory frame = frame_of(3, false);
    FrameMessage message;
    ASSERT_EQ(encoder.encode(frame.frame, message), Status::ok);
    const std::vector<uint8_t> depth(message.depth.begin(), message.depth.end());
    const std::vector<uint8_t> colour(message.colour.begin(), message.colour.end());
    int refused = 0;
    for (int round = 0; round < 300; ++round) {
      std::vector<uint8_t> d = depth, c = colour;
      for (int flip = 0; flip < 4; ++flip) {
        d[random() % d.size()] = static_cast<uint8_t>(random());
        c[random() % c.size()] = static_cast<uint8_t>(random());
      }
      if (round % 3 == 0) c.resize(random() % c.size());
      message.depth = {d.data(), static_cast<uint32_t>(d.size())};
      message.colour = {c.data(), static_cast<uint32_t>(c.size())};
      message.crc32c = checksum_of(message);
      FrameMemory back(kCols, kRows);
      refused += decoder.decode(message, back.frame) == Status::bad_data;
    }
    EXPECT_GT(refused, 100);
  }
  FrameMessage nothing;
  FrameMemory back(kCols, kRows);
  EXPECT_EQ(decoder.decode(nothing, back.frame), Status::bad_data);
}

TEST(FrameCoder, ImagesOfAnotherSizeAreRefused) {
  for (const ImageCoding coding : {ImageCoding::zstd_colour, ImageCoding::jpeg}) {
    FrameEncoder encoder(kRows, kCols, coding);
    const FrameMemory frame = frame_of(3, false);
    FrameMessage message;
    ASSERT_EQ(encoder.encode(frame.frame, message), Status::ok);
    FrameDecoder decoder;
    for (const auto& [cols, rows] : {std::pair{kCols - 8, kRows}, std::pair{kCols, kRows + 8}}) {
      FrameMemory back(cols, rows);
      EXPECT_EQ(decoder.decode(message, back.frame), Status::bad_data);
    }
  }
}

}  // namespace
}  // namespace stillmap
