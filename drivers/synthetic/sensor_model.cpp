#include "drivers/synthetic/sensor_model.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/synthetic/random.hpp"

namespace stillmap::synthetic {

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kDisparityConstant = kDisparityFocalPx * kBaselineM;  // px m: disparity = this / depth
constexpr float kEdgeRatio = 0.04f;  // neighbours whose depth differs by this share lie across an edge

float degrees_cos(float degrees) {
  return static_cast<float>(std::cos(static_cast<double>(degrees) * kPi / 180.0));
}

}  // namespace

SensorModel::SensorModel(const Intrinsics& k, float depth_units_per_m, uint64_t seed)
    : k_(k), depth_units_per_m_(depth_units_per_m), seed_(seed) {
  const auto bands = static_cast<size_t>((k.height + kBandRows - 1) / kBandRows);
  const auto cols = static_cast<size_t>(k.width);
  noise_.resize(bands * cols);
  shadow_.resize(bands * cols);
  white_.resize(bands * cols * (kBandRows + 2));
}

float SensorModel::exposure(double t_s) const {
  const auto turn = [&](uint32_t field) {
    return 2.0 * kPi * static_cast<double>(unit(field_key(seed_, 0, field)));
  };
  const double slow = std::sin(2.0 * kPi * t_s / 7.3 + turn(11));
  const double slower = std::sin(2.0 * kPi * t_s / 17.0 + turn(12));
  return static_cast<float>(1.0 + static_cast<double>(kExposureDrift) * (0.6 * slow + 0.4 * slower));
}

void SensorModel::measure(const IdealImages& images, uint32_t frame, double t_s, ThreadPool& workers,
                          ImageView<uint16_t> depth_raw, ImageView<Rgb8> colour) {
  const FrameKeys keys = {field_key(seed_, frame, 1), field_key(seed_, frame, 2), field_key(seed_, frame, 3),
                          field_key(seed_, frame, 4)};
  const float gain = exposure(t_s);
  workers.for_each(static_cast<uint32_t>((k_.height + kBandRows - 1) / kBandRows), [&](uint32_t band) {
    measure_band(images, keys, gain, static_cast<int32_t>(band), depth_raw, colour);
  });
}

void SensorModel::measure_band(const IdealImages& images, const FrameKeys& keys, float gain, int32_t band,
                               ImageView<uint16_t> depth_raw, ImageView<Rgb8> colour) {
  const auto cols = static_cast<size_t>(k_.width);
  float* white = white_.data() + static_cast<size_t>(band) * cols * (kBandRows + 2);
  float* noise = noise_.data() + static_cast<size_t>(band) * cols;
  uint8_t* shadow = shadow_.data() + static_cast<size_t>(band) * cols;
  const int32_t row0 = band * kBandRows;
  const int32_t rows = std::min(kBandRows, k_.height - row0);
  for (int32_t r = -1; r <= rows; ++r)
    for (int32_t c = 0; c < k_.width; ++c)
      white[static_cast<size_t>(r + 1) * cols + static_cast<size_t>(c)] =
          2.0f * unit(pixel_bits(keys.disparity, row0 + r, c)) - 1.0f;
  for (int32_t r = 0; r < rows; ++r) {
    const float* here = white + static_cast<size_t>(r + 1) * cols;
    smooth_noise_row(here - cols, here, here + cols, k_.width, noise);
    measure_depth_row(images, keys, row0 + r, noise, shadow, depth_raw.row(row0 + r));
    colour_row(images.colour.data() + static_cast<size_t>(row0 + r) * cols, keys.colour, gain, row0 + r,
               colour.row(row0 + r));
  }
}

void smooth_noise_row(const float* above, const float* here, const float* below, int32_t cols, float* out) {
  // A sum of nine numbers uniform in -1..1 has variance 3.
  const float scale = 0.57735027f;
  const auto column = [&](int32_t c) {
    const int32_t i = std::clamp(c, 0, cols - 1);
    return above[i] + here[i] + below[i];
  };
  float left = column(-1), middle = column(0);
  for (int32_t c = 0; c < cols; ++c) {
    const float right = column(c + 1);
    out[c] = scale * (left + middle + right);
    left = middle;
    middle = right;
  }
}

void SensorModel::find_shadow(const float* depth_m, uint8_t* shadow) const {
  // The projector sees this row too, each point at column - fx * baseline / depth. Where that order breaks, a
  // nearer point to the right takes the light.
  float nearest_column = 1e9f;
  for (int32_t c = k_.width - 1; c >= 0; --c) {
    const float column = static_cast<float>(c) - k_.fx * kBaselineM / depth_m[c];
    shadow[c] = column > nearest_column ? 1 : 0;
    nearest_column = std::min(nearest_column, column);
  }
}

void SensorModel::measure_depth_row(const IdealImages& images, const FrameKeys& keys, int32_t row,
                                    const float* noise, uint8_t* shadow, uint16_t* out) const {
  static const float cos_start = degrees_cos(kGrazingStartDeg), cos_end = degrees_cos(kGrazingEndDeg);
  const auto cols = static_cast<ptrdiff_t>(k_.width);
  const float* depth = images.depth_m.data() + row * cols;
  const float* cosine = images.cos_incidence.data() + row * cols;
  const float* above = row > 0 ? depth - cols : depth;
  const float* below = row + 1 < k_.height ? depth + cols : depth;
  find_shadow(depth, shadow);
  for (int32_t c = 0; c < k_.width; ++c) {
    const int32_t left = c > 0 ? c - 1 : c, right = c + 1 < k_.width ? c + 1 : c;
    float z = depth[c];
    const float gate = kEdgeRatio * z;
    if (std::abs(depth[right] - depth[left]) > gate || std::abs(below[c] - above[c]) > gate) {
      // Beside an edge the matching window catches the one side or the other, rarely something between.
      const uint32_t bits = pixel_bits(keys.place, row, c);
      const float* line = (bits & 0x3u) == 0 ? above : (bits & 0x3u) == 1 ? below : depth;
      const int32_t from = (bits & 0xcu) == 0 ? left : (bits & 0xcu) == 4 ? right : c;
      const float other = line[from];
      z = unit(bits) < kFlyingPixelShare ? 0.5f * (z + other) : other;
    }
    const float loss = unit(pixel_bits(keys.loss, row, c));
    const float grazing = std::clamp((cos_start - cosine[c]) / (cos_start - cos_end), 0.0f, 1.0f);
    const float disparity = kDisparityConstant / z + kDisparitySigmaPx * noise[c];
    const float steps = std::max(std::floor(disparity / kDisparityStepPx + 0.5f), 1.0f);
    const float measured_m = kDisparityConstant / (steps * kDisparityStepPx);
    const bool valid = shadow[c] == 0 && loss >= kSpeckleDropOut + grazing && measured_m >= kDepthMinM &&
                       measured_m <= kDepthMaxM;
    out[c] = valid ? static_cast<uint16_t>(std::min(measured_m * depth_units_per_m_ + 0.5f, 65534.0f))
                   : uint16_t{0};
  }
}

void SensorModel::colour_row(const Rgb8* ideal, uint32_t key, float gain, int32_t row, Rgb8* out) const {
  // Two 5-bit numbers make a triangular distribution of this standard deviation.
  constexpr float kTriangleSigma = 13.056f;
  constexpr float scale = kColourSigma / kTriangleSigma;
  for (int32_t c = 0; c < k_.width; ++c) {
    const uint32_t bits = pixel_bits(key, row, c);
    const auto noise = [&](uint32_t shift) {
      return scale * (static_cast<float>(((bits >> shift) & 31u) + ((bits >> (shift + 5)) & 31u)) - 31.0f);
    };
    out[c] = {to_byte(gain * static_cast<float>(ideal[c].r) + noise(0)),
              to_byte(gain * static_cast<float>(ideal[c].g) + noise(10)),
              to_byte(gain * static_cast<float>(ideal[c].b) + noise(20))};
  }
}

}  // namespace stillmap::synthetic
