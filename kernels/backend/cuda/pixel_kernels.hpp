#pragma once

// Kernels that call an element function for every pixel or cell, and what goes with them.

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/mask/cells.hpp"
#include "kernels/mask/residual_mask.hpp"
#include "kernels/prepare/prepare_pixel.hpp"

namespace stillmap {

/// (*pass)(row, col) for every `step`-th pixel of every `step`-th row.
template <class Pass>
struct PixelKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  const Pass* pass;
  int32_t rows, cols;  ///< of the image
  int32_t step = 1;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const Pass p = *pass;
    const int32_t across = (cols + step - 1) / step, down = (rows + step - 1) / step;
    for_all(block, static_cast<uint32_t>(across * down), [&](uint32_t i) {
      const auto n = static_cast<int32_t>(i);
      p(n / across * step, n % across * step);
    });
  }
};
/// The same with a cache of blocks, which on the GPU is the last block only.
template <class Pass>
struct MapPixelKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  const Pass* pass;
  int32_t rows, cols;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const Pass p = *pass;
    for_all(block, static_cast<uint32_t>(rows * cols), [&](uint32_t i) {
      BlockCache cache;
      p(static_cast<int32_t>(i) / cols, static_cast<int32_t>(i) % cols, cache);
    });
  }
};

/// Prepared images, nothing masked, every pixel trusted; counts the pixels with a depth in range.
struct PrepareKernel {
  static constexpr uint32_t kLanes = 256;
  struct Shared {
    uint32_t warps[kLanes / kWarp];
  };
  const PreparePass* pass;
  ImageView<uint8_t> mask, trust;
  uint32_t* valid;  ///< 0 before

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const PreparePass p = *pass;
    PerLane<Block, uint32_t> count;
    block.privately([&](uint32_t lane) { count[lane] = 0; });
    for_all(block, static_cast<uint32_t>(mask.pixels()), [&](uint32_t i) {
      const auto n = static_cast<int32_t>(i);
      count[i % kLanes] += static_cast<uint32_t>(p(n / mask.cols, n % mask.cols));
      mask.data[i] = 0;
      trust.data[i] = 255;
    });
    const uint32_t sum = sum_over_block(block, count, block.shared().warps);
    block.each([&](uint32_t lane) {
      if (lane == 0) atomic_add(valid, sum);
    });
  }
};

/// A byte into every element.
struct FillBytesKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  View<uint8_t> bytes;
  uint8_t value;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, bytes.size, [&](uint32_t i) { bytes[i] = value; });
  }
};

/// Along rows or columns: set where all (erosion) or any (dilation) of the pixels within the radius are; what
/// lies outside counts for neither.
template <bool kErode>
struct SlideKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  ImageView<const uint8_t> in;
  ImageView<uint8_t> out;
  int32_t radius_px;
  bool along_rows;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, static_cast<uint32_t>(in.pixels()), [&](uint32_t i) {
      const int32_t r = static_cast<int32_t>(i) / in.cols, c = static_cast<int32_t>(i) % in.cols;
      const int32_t at = along_rows ? c : r, length = along_rows ? in.cols : in.rows;
      const int32_t first = at - radius_px < 0 ? 0 : at - radius_px;
      const int32_t last = at + radius_px >= length ? length - 1 : at + radius_px;
      bool set = kErode;
      for (int32_t n = first; n <= last && set == kErode; ++n)
        set = (along_rows ? in.at(r, n) : in.at(n, c)) != 0;
      out.at(r, c) = set ? kMasked : uint8_t{0};
    });
  }
};

/// Trust from a mask of the paper's method, all or nothing.
struct TrustUnmaskedKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  ImageView<const uint8_t> mask;
  ImageView<uint8_t> trust;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, static_cast<uint32_t>(mask.pixels()),
            [&](uint32_t i) { trust.data[i] = mask.data[i] ? 0 : 255; });
  }
};

/// How many pixels are masked, and how many of them have a depth.
struct CountMaskedKernel {
  static constexpr uint32_t kLanes = 256;
  struct Counts {
    uint32_t masked, with_depth;
    STILLMAP_HD friend Counts operator+(Counts a, Counts b) {
      return {a.masked + b.masked, a.with_depth + b.with_depth};
    }
  };
  struct Shared {
    Counts warps[kLanes / kWarp];
  };
  ImageView<const uint8_t> mask;
  ImageView<const float> depth_m;
  Counts* counts;  ///< 0 before

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    PerLane<Block, Counts> own;
    block.privately([&](uint32_t lane) { own[lane] = {0, 0}; });
    for_all(block, static_cast<uint32_t>(mask.pixels()), [&](uint32_t i) {
      if (!mask.data[i]) return;
      ++own[i % kLanes].masked;
      own[i % kLanes].with_depth += static_cast<uint32_t>(depth_m.data[i] > 0.0f);
    });
    const Counts sum = sum_over_block(block, own, block.shared().warps);
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      atomic_add(&counts->masked, sum.masked);
      atomic_add(&counts->with_depth, sum.with_depth);
    });
  }
};

}  // namespace stillmap
