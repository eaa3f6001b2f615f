#pragma once

// A view as a short code (random ferns: Glocker et al., "Real-Time RGB-D Camera Relocalization via Randomized
// Ferns for Keyframe Encoding", TVCG 2015). A fern looks at one cell with four tests; views of the same place
// agree in most ferns.

#include <cstdint>

#include "kernels/base/mix_bits.hpp"
#include "kernels/relocalise/small_view.hpp"

namespace stillmap {

constexpr uint8_t kNoVote = 255;        ///< the cell of the fern is masked or has no depth
constexpr float kVotesNeeded = 0.2f;    ///< share of the ferns that must see something in both views
constexpr float kFernNearest_m = 0.5f;  ///< the depth tests lie between these
constexpr float kFernFarthest_m = 4.0f;
constexpr float kFernDarkest = 0.5f;  ///< the luminance tests, over the mean of the view
constexpr float kFernBrightest = 1.5f;

/// Where a fern looks and what it compares with; the same for everyone, drawn once and for all by a hash.
struct Fern {
  int32_t row = 0, col = 0;
  float depth_m[2] = {};
  float luma[2] = {};  ///< times the mean luminance of the view
};
STILLMAP_HD Fern fern_of(uint32_t index, int32_t rows, int32_t cols) {
  const auto unit = [&](uint32_t draw) {
    return static_cast<float>(mix_bits(index * 8 + draw + 1) >> 8) * (1.0f / 16777216.0f);
  };
  Fern fern;
  fern.row = static_cast<int32_t>(unit(0) * static_cast<float>(rows));
  fern.col = static_cast<int32_t>(unit(1) * static_cast<float>(cols));
  for (uint32_t i = 0; i < 2; ++i) {
    fern.depth_m[i] = kFernNearest_m + unit(2 + i) * (kFernFarthest_m - kFernNearest_m);
    fern.luma[i] = kFernDarkest + unit(4 + i) * (kFernBrightest - kFernDarkest);
  }
  return fern;
}

/// The four answers of one fern, a bit each, or kNoVote.                        test: fern_code_test
struct FernPass {
  SmallView view;
  float mean_luma = 0;
  View<uint8_t> code;

  STILLMAP_HD void operator()(uint32_t index) const {
    const Fern fern = fern_of(index, view.depth_m.rows, view.depth_m.cols);
    const float z_m = view.depth_m.at(fern.row, fern.col), luma = view.luma.at(fern.row, fern.col);
    if (z_m <= 0.0f || luma == kNoLuma) {
      code[index] = kNoVote;
      return;
    }
    int32_t bits = 0;
    for (int32_t i = 0; i < 2; ++i) {
      bits |= static_cast<int32_t>(z_m > fern.depth_m[i]) << i;
      bits |= static_cast<int32_t>(luma > fern.luma[i] * mean_luma) << (2 + i);
    }
    code[index] = static_cast<uint8_t>(bits);
  }
};

/// Share of equal ferns among those that vote in both codes; 0 when these are too few. test: fern_code_test
STILLMAP_HD float code_similarity(View<const uint8_t> a, View<const uint8_t> b) {
  int32_t votes = 0, equal = 0;
  for (uint32_t i = 0; i < a.size; ++i) {
    const bool both = a[i] != kNoVote && b[i] != kNoVote;
    votes += static_cast<int32_t>(both);
    equal += static_cast<int32_t>(both && a[i] == b[i]);
  }
  if (static_cast<float>(votes) < kVotesNeeded * static_cast<float>(a.size) || votes == 0) return 0.0f;
  return static_cast<float>(equal) / static_cast<float>(votes);
}

}  // namespace stillmap
