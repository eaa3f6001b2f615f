#include "drivers/synthetic/sensor_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "drivers/synthetic/random.hpp"

namespace stillmap::synthetic {
namespace {

constexpr int32_t kCols = 320, kRows = 64;
constexpr Intrinsics kSensorCamera = {525.0f, 525.0f, 159.5f, 31.5f, kCols, kRows};
constexpr float kUnits = 5000.0f;

struct Measured {
  std::vector<uint16_t> depth = std::vector<uint16_t>(kCols * kRows);
  std::vector<Rgb8> colour = std::vector<Rgb8>(kCols * kRows);

  float depth_m(int32_t row, int32_t col) const {
    return static_cast<float>(depth[static_cast<size_t>(row * kCols + col)]) / kUnits;
  }
};

using DepthOf = std::function<float(int32_t row, int32_t col)>;

IdealImages ideal(const DepthOf& depth_m, float cos_incidence = 1.0f) {
  IdealImages images;
  images.depth_m.resize(kCols * kRows);
  images.cos_incidence.assign(kCols * kRows, cos_incidence);
  images.colour.assign(kCols * kRows, Rgb8{100, 150, 200});
  images.mask.assign(kCols * kRows, 0);
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) images.depth_m[static_cast<size_t>(r * kCols + c)] = depth_m(r, c);
  return images;
}

Measured measure(const IdealImages& images, uint32_t frame = 0, double t_s = 0) {
  Measured out;
  ThreadPool workers(1);
  SensorModel sensor(kSensorCamera, kUnits, 7);
  sensor.measure(images, frame, t_s, workers, {out.depth.data(), kRows, kCols, kCols},
                 {out.colour.data(), kRows, kCols, kCols});
  return out;
}

/// Standard deviation of the depth error on a wall about `z_m` away, slanted so that it crosses disparity
/// steps.
double sigma_at_m(float z_m) {
  const auto wall = [&](int32_t row, int32_t col) {
    return z_m * (1.0f + 1e-4f * static_cast<float>(col) + 2e-4f * static_cast<float>(row));
  };
  const IdealImages images = ideal(wall);
  double sum = 0, sum2 = 0;
  int count = 0;
  for (uint32_t frame = 0; frame < 4; ++frame) {
    const Measured m = measure(images, frame);
    for (int32_t r = 0; r < kRows; ++r)
      for (int32_t c = 0; c < kCols; ++c) {
        if (m.depth_m(r, c) == 0.0f) continue;
        const auto e = static_cast<double>(m.depth_m(r, c) - wall(r, c));
        sum += e;
        sum2 += e * e;
        ++count;
      }
  }
  EXPECT_GT(count, 4 * kCols * kRows * 9 / 10);
  EXPECT_LT(std::abs(sum / count), 0.001 * static_cast<double>(z_m * z_m)) << "biased";
  return std::sqrt(sum2 / count - (sum / count) * (sum / count));
}

TEST(SensorModel, noise_is_3_mm_or_more_at_2_m_and_grows_with_z_squared) {
  const double at_1 = sigma_at_m(1.0f), at_2 = sigma_at_m(2.0f), at_4 = sigma_at_m(4.0f);
  EXPECT_GE(at_2, 0.003);
  EXPECT_LE(at_2, 0.008);
  EXPECT_NEAR(at_2 / at_1, 4.0, 0.8);
  EXPECT_NEAR(at_4 / at_2, 4.0, 0.8);
}

TEST(SensorModel, depths_are_disparity_steps) {
  const Measured m = measure(ideal([](int32_t r, int32_t c) {
    return 1.0f + 0.004f * static_cast<float>(c) + 0.001f * static_cast<float>(r);
  }));
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      if (m.depth_m(r, c) == 0.0f) continue;
      const double steps =
          static_cast<double>(kDisparityFocalPx * kBaselineM / (m.depth_m(r, c) * kDisparityStepPx));
      // Rounding to 0.2 mm moves it a little.
      ASSERT_NEAR(steps, std::round(steps), 0.06 * std::max(1.0, 1.0 / static_cast<double>(m.depth_m(r, c))));
    }
}

TEST(SensorModel, noise_has_unit_variance_and_is_shared_by_neighbours) {
  constexpr int32_t cols = 2000;
  std::vector<float> rows[3], out(cols);
  for (int32_t r = 0; r < 3; ++r)
    for (int32_t c = 0; c < cols; ++c) rows[r].push_back(2.0f * unit(pixel_bits(99, r, c)) - 1.0f);
  smooth_noise_row(rows[0].data(), rows[1].data(), rows[2].data(), cols, out.data());
  double variance = 0, next = 0, far = 0;
  for (size_t c = 0; c + 5 < cols; ++c) {
    variance += static_cast<double>(out[c] * out[c]) / cols;
    next += static_cast<double>(out[c] * out[c + 1]) / cols;
    far += static_cast<double>(out[c] * out[c + 5]) / cols;
  }
  EXPECT_NEAR(variance, 1.0, 0.12);
  EXPECT_NEAR(next / variance, 2.0 / 3.0, 0.1);
  EXPECT_NEAR(far / variance, 0.0, 0.1);
}

TEST(SensorModel, nothing_nearer_or_farther_than_the_limits) {
  const auto share_valid = [](float z_m) {
    const Measured m = measure(ideal([&](int32_t, int32_t) { return z_m; }));
    int valid = 0;
    for (const uint16_t d : m.depth) {
      valid += d != 0 ? 1 : 0;
      if (d == 0) continue;
      EXPECT_GE(static_cast<float>(d), kDepthMinM * kUnits - 1.0f);
      EXPECT_LE(static_cast<float>(d), kDepthMaxM * kUnits + 1.0f);
    }
    return static_cast<double>(valid) / (kCols * kRows);
  };
  EXPECT_EQ(share_valid(0.10f), 0.0);
  EXPECT_EQ(share_valid(0.43f), 0.0);
  EXPECT_GT(share_valid(0.50f), 0.99);
  EXPECT_GT(share_valid(4.50f), 0.99);
  EXPECT_EQ(share_valid(5.60f), 0.0);
  EXPECT_EQ(share_valid(400.0f), 0.0);
}

TEST(SensorModel, grazing_surfaces_drop_out) {
  const auto share_valid = [](float degrees) {
    const Measured m =
        measure(ideal([](int32_t, int32_t) { return 2.0f; }, std::cos(degrees * 0.017453293f)));
    int valid = 0;
    for (const uint16_t d : m.depth) valid += d != 0 ? 1 : 0;
    return static_cast<double>(valid) / (kCols * kRows);
  };
  EXPECT_GT(share_valid(0.0f), 0.99);
  EXPECT_GT(share_valid(74.0f), 0.99);
  EXPECT_NEAR(share_valid(81.0f), 0.5, 0.1);
  EXPECT_EQ(share_valid(88.0f), 0.0);
}

TEST(SensorModel, projector_shadow_lies_to_the_left_of_a_near_box) {
  const int32_t first = 160, last = 219;  // columns of a box 1 m away before a wall 2 m away
  const Measured m =
      measure(ideal([&](int32_t, int32_t c) { return c >= first && c <= last ? 1.0f : 2.0f; }));
  // It is as wide as the disparities differ: fx * baseline * (1/1 - 1/2) = 19.7 columns.
  int dark_left = 0, dark_right = 0, dark_box = 0;
  for (int32_t r = 0; r < kRows; ++r) {
    for (int32_t c = first - 17; c < first - 1; ++c) dark_left += m.depth_m(r, c) == 0.0f ? 1 : 0;
    for (int32_t c = last + 2; c < last + 40; ++c) dark_right += m.depth_m(r, c) == 0.0f ? 1 : 0;
    for (int32_t c = first + 1; c < last; ++c) dark_box += m.depth_m(r, c) == 0.0f ? 1 : 0;
    EXPECT_EQ(m.depth_m(r, first - 10), 0.0f);
  }
  EXPECT_EQ(dark_left, 16 * kRows);
  EXPECT_LT(dark_right, kRows);
  EXPECT_LT(dark_box, kRows);
  int dark_far_left = 0;
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 60; c < first - 22; ++c) dark_far_left += m.depth_m(r, c) == 0.0f ? 1 : 0;
  EXPECT_LT(dark_far_left, 2 * kRows);
}

TEST(SensorModel, a_few_pixels_fly_between_the_sides_of_an_edge) {
  // Above and below an edge there is no shadow: both sides are measured.
  const Measured m = measure(ideal([](int32_t r, int32_t) { return r < 32 ? 2.0f : 1.0f; }));
  int flying = 0, other = 0;
  for (int32_t r = 0; r < kRows; ++r)
    for (int32_t c = 0; c < kCols; ++c) {
      const float z = m.depth_m(r, c);
      const bool between = z > 1.2f && z < 1.8f;
      if (r >= 31 && r <= 32)
        flying += between ? 1 : 0;
      else
        other += between ? 1 : 0;
    }
  EXPECT_GT(flying, 2);
  EXPECT_LT(flying, kCols / 5);
  EXPECT_EQ(other, 0);
}

TEST(SensorModel, colour_noise_is_2_to_3_grey_levels_and_exposure_drifts_slowly) {
  const IdealImages images = ideal([](int32_t, int32_t) { return 2.0f; });
  const Measured m = measure(images);
  double sum = 0, sum2 = 0;
  for (const Rgb8& p : m.colour) {
    sum += p.g;
    sum2 += static_cast<double>(p.g) * p.g;
  }
  const double mean = sum / (kCols * kRows);
  EXPECT_NEAR(std::sqrt(sum2 / (kCols * kRows) - mean * mean), 2.5, 0.3);
  const SensorModel sensor(kSensorCamera, kUnits, 7);
  EXPECT_NEAR(mean, 150.0 * static_cast<double>(sensor.exposure(0)), 0.2);
  float low = 2, high = 0;
  for (int i = 0; i < 600; ++i) {
    const float gain = sensor.exposure(i / 30.0);
    low = std::min(low, gain);
    high = std::max(high, gain);
    EXPECT_NEAR(gain, sensor.exposure((i + 1) / 30.0), 0.004f);
  }
  EXPECT_GE(low, 0.9f);
  EXPECT_LE(high, 1.1f);
  EXPECT_GT(high - low, 0.05f);
}

}  // namespace
}  // namespace stillmap::synthetic
