#pragma once

// What a structured-light camera (Asus Xtion) makes of the ideal images.

#include <cstdint>
#include <vector>

#include "drivers/synthetic/renderer.hpp"
#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/view.hpp"

namespace stillmap::synthetic {

inline constexpr float kDepthMinM = 0.45f;          ///< nearer surfaces give no depth
inline constexpr float kDepthMaxM = 5.0f;           ///< farther ones neither
inline constexpr float kBaselineM = 0.075f;         ///< projector to the right of the camera
inline constexpr float kDisparityFocalPx = 580.0f;  ///< of the infrared camera at full resolution
inline constexpr float kDisparityStepPx = 0.125f;   ///< sub-pixel resolution of the matcher
inline constexpr float kDisparitySigmaPx = 0.04f;  ///< before the steps: 3.7 mm at 2 m; with the steps 4.9 mm
inline constexpr float kGrazingStartDeg = 75.0f;   ///< incidence at which drop-outs begin ...
inline constexpr float kGrazingEndDeg = 87.0f;     ///< ... and where nothing is measured any more
inline constexpr float kSpeckleDropOut = 0.002f;   ///< share of pixels lost anywhere
inline constexpr float kFlyingPixelShare = 0.06f;  ///< of the pixels beside a depth edge
inline constexpr float kColourSigma = 2.5f;        ///< grey levels
inline constexpr float kExposureDrift = 0.08f;     ///< the gain stays within 1 -+ this

/// Depth noise, disparity steps, projector shadow, drop-outs, range limits, colour noise and exposure drift;
/// a pure function of the images, the seed and the frame number.
/// @thread one caller at a time
class SensorModel {
 public:
  SensorModel(const Intrinsics& k, float depth_units_per_m, uint64_t seed);

  /// @param depth_raw, colour size of the camera
  void measure(const IdealImages& images, uint32_t frame, double t_s, ThreadPool& workers,
               ImageView<uint16_t> depth_raw, ImageView<Rgb8> colour);

  /// Camera gain at time `t_s`: slow, within 1 -+ kExposureDrift.
  float exposure(double t_s) const;

 private:
  static constexpr int32_t kBandRows = 16;
  struct FrameKeys {
    uint32_t disparity, place, loss, colour;
  };

  void measure_band(const IdealImages& images, const FrameKeys& keys, float gain, int32_t band,
                    ImageView<uint16_t> depth_raw, ImageView<Rgb8> colour);
  void measure_depth_row(const IdealImages& images, const FrameKeys& keys, int32_t row, const float* noise,
                         uint8_t* shadow, uint16_t* out) const;
  void find_shadow(const float* depth_m, uint8_t* shadow) const;
  void colour_row(const Rgb8* ideal, uint32_t key, float gain, int32_t row, Rgb8* out) const;

  Intrinsics k_;
  float depth_units_per_m_;
  uint64_t seed_;
  std::vector<float> noise_;     // one smoothed row for each band
  std::vector<uint8_t> shadow_;  // one row for each band
  std::vector<float> white_;     // kBandRows + 2 rows for each band
};

/// Adds what a row of independent numbers lacks: each output is the mean of 3 x 3, brought back to
/// variance 1.
/// @param above, here, below `cols` numbers, uniform in -1..1
void smooth_noise_row(const float* above, const float* here, const float* below, int32_t cols, float* out);

}  // namespace stillmap::synthetic
