#pragma once

// Completing a kept frame on the GPU (paper III-E).

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/complete/temporary_model.hpp"

namespace stillmap {

/// Start depths of all frames of the model; what they are written over is TemporaryModel::kNoStart.
struct StartDepthKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  const StartDepthPass* pass;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const StartDepthPass p = *pass;
    const int32_t rows = p.model.cell_rows, cols = p.model.cell_cols;
    for_all(block, static_cast<uint32_t>(p.model.frames * rows * cols), [&](uint32_t i) {
      const auto n = static_cast<int32_t>(i);
      p(n / cols / rows, n / cols % rows, n % cols);
    });
  }
};

}  // namespace stillmap
