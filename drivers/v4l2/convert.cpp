#include "drivers/v4l2/convert.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace stillmap {
namespace {

const uint8_t* row_of(RawImage image, int32_t row) {
  return image.data + static_cast<size_t>(row) * image.pitch_bytes;
}

static_assert(std::endian::native == std::endian::little);

/// Pairs of pixels that are worked on at a time: planes of that many stay in the nearest cache, and every
/// loop over them becomes vector instructions.
constexpr int32_t kPairs = 64;

/// gain * 2^3, as a factor of (value * 64) whose upper 16 bits are kept: results in eighths of a level.
constexpr int16_t factor(double gain) {
  return static_cast<int16_t>(gain * 8 * 1024 + 0.5);
}
constexpr int16_t kLuma = factor(255.0 / 219);
constexpr int16_t kRedOfV = factor(1.402 * 255 / 224);
constexpr int16_t kGreenOfU = factor(0.344136 * 255 / 224);
constexpr int16_t kGreenOfV = factor(0.714136 * 255 / 224);
constexpr int16_t kBlueOfU = factor(1.772 * 255 / 224);

inline int16_t scaled(int16_t value_64, int16_t factor) {
  return static_cast<int16_t>((static_cast<int32_t>(value_64) * factor) >> 16);
}
inline uint8_t level(int16_t eighths) {
  const auto rounded =
      static_cast<int16_t>(eighths + 4);  // 16 bits throughout: as many lanes as there can be
  const auto value = static_cast<int16_t>(rounded >> 3);
  return static_cast<uint8_t>(value < 0 ? 0 : value > 255 ? 255 : value);
}

/// Channels of the even pixels and of the odd ones.
struct Planes {
  uint8_t r0[kPairs], g0[kPairs], b0[kPairs];
  uint8_t r1[kPairs], g1[kPairs], b1[kPairs];
};

/// @param yuyv kPairs pairs, whether they are all wanted or not: the length of the loops is known
void planes_of(const uint8_t* yuyv, Planes& planes) {
  uint32_t words[kPairs];
  std::memcpy(words, yuyv, sizeof(words));
  int16_t luma0[kPairs], luma1[kPairs], red[kPairs], green[kPairs], blue[kPairs];
  for (int32_t i = 0; i < kPairs; ++i) {
    const auto byte = [&](int n) { return static_cast<int16_t>(words[i] >> (8 * n) & 0xff); };
    luma0[i] = static_cast<int16_t>((byte(0) - 16) * 64);
    luma1[i] = static_cast<int16_t>((byte(2) - 16) * 64);
    blue[i] = static_cast<int16_t>((byte(1) - 128) * 64);
    red[i] = static_cast<int16_t>((byte(3) - 128) * 64);
  }
  for (int32_t i = 0; i < kPairs; ++i) {
    const int16_t u = blue[i], v = red[i];
    luma0[i] = scaled(luma0[i], kLuma);
    luma1[i] = scaled(luma1[i], kLuma);
    red[i] = scaled(v, kRedOfV);
    green[i] = static_cast<int16_t>(scaled(u, kGreenOfU) + scaled(v, kGreenOfV));
    blue[i] = scaled(u, kBlueOfU);
  }
  for (int32_t i = 0; i < kPairs; ++i) {
    planes.r0[i] = level(static_cast<int16_t>(luma0[i] + red[i]));
    planes.g0[i] = level(static_cast<int16_t>(luma0[i] - green[i]));
    planes.b0[i] = level(static_cast<int16_t>(luma0[i] + blue[i]));
  }
  for (int32_t i = 0; i < kPairs; ++i) {
    planes.r1[i] = level(static_cast<int16_t>(luma1[i] + red[i]));
    planes.g1[i] = level(static_cast<int16_t>(luma1[i] - green[i]));
    planes.b1[i] = level(static_cast<int16_t>(luma1[i] + blue[i]));
  }
}

/// Two pixels are six bytes: written as eight, of which the next pair overwrites two.
void interleave(const Planes& p, int32_t pairs, Rgb8* to) {
  auto* bytes = reinterpret_cast<uint8_t*>(to);
  const auto at = [](uint8_t value, int byte) { return static_cast<uint64_t>(value) << (8 * byte); };
  for (int32_t i = 0; i + 1 < pairs; ++i) {
    const uint64_t pair =
        at(p.r0[i], 0) | at(p.g0[i], 1) | at(p.b0[i], 2) | at(p.r1[i], 3) | at(p.g1[i], 4) | at(p.b1[i], 5);
    std::memcpy(bytes + 6 * i, &pair, sizeof(pair));
  }
  const int32_t last = pairs - 1;
  to[2 * last] = {p.r0[last], p.g0[last], p.b0[last]};
  to[2 * last + 1] = {p.r1[last], p.g1[last], p.b1[last]};
}

}  // namespace

void copy_depth(RawImage from, ImageView<uint16_t> to) {
  for (int32_t row = 0; row < to.rows; ++row)
    std::memcpy(to.row(row), row_of(from, row), sizeof(uint16_t) * static_cast<size_t>(to.cols));
}

void copy_rgb(RawImage from, ImageView<Rgb8> to) {
  for (int32_t row = 0; row < to.rows; ++row)
    std::memcpy(static_cast<void*>(to.row(row)), row_of(from, row),
                sizeof(Rgb8) * static_cast<size_t>(to.cols));
}

void grey_to_rgb(RawImage from, ImageView<Rgb8> to) {
  for (int32_t row = 0; row < to.rows; ++row) {
    const uint8_t* const grey = row_of(from, row);
    Rgb8* const rgb = to.row(row);
    for (int32_t col = 0; col < to.cols; ++col) rgb[col] = {grey[col], grey[col], grey[col]};
  }
}

void yuyv_to_rgb(RawImage from, ImageView<Rgb8> to) {
  Planes planes;
  for (int32_t row = 0; row < to.rows; ++row)
    for (int32_t pair = 0; pair < to.cols / 2; pair += kPairs) {
      const int32_t pairs = std::min(kPairs, to.cols / 2 - pair);
      const uint8_t* yuyv = row_of(from, row) + 4 * pair;
      uint8_t rest[4 * kPairs] = {};
      if (pairs < kPairs)
        yuyv = static_cast<const uint8_t*>(std::memcpy(rest, yuyv, 4 * static_cast<size_t>(pairs)));
      planes_of(yuyv, planes);
      interleave(planes, pairs, to.row(row) + 2 * pair);
    }
}

void fill_mid_grey(ImageView<Rgb8> to) {
  for (int32_t row = 0; row < to.rows; ++row)
    std::memset(static_cast<void*>(to.row(row)), 128, sizeof(Rgb8) * static_cast<size_t>(to.cols));
}

}  // namespace stillmap
