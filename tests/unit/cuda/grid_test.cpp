// Sums, ranks and the last block on the emulated grid; connected regions beside the flood fill.

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <vector>

#include "kernels/backend/cuda/mask_kernels.hpp"
#include "kernels/backend/cuda/pixel_kernels.hpp"
#include "kernels/engine.hpp"
#include "kernels/mask/grow_mask.hpp"
#include "tests/support/emulated_grid.hpp"

namespace stillmap {
namespace {

constexpr LaneOrder kOrders[] = {LaneOrder::rising, LaneOrder::falling, LaneOrder::shuffled};

struct Pair {
  uint32_t a, b;
  friend Pair operator+(Pair x, Pair y) { return {x.a + y.a, x.b + y.b}; }
  friend Pair operator-(Pair x, Pair y) { return {x.a - y.a, x.b - y.b}; }
};

/// Ranks the values of each block, and adds them up; the last block adds up the blocks.
struct RankKernel {
  static constexpr uint32_t kLanes = 96;
  struct Shared {
    Pair warps[kLanes / kWarp];
    bool last;
  };
  View<const uint32_t> values;
  View<Pair> ranks, sums, scanned_sums;
  uint32_t* arrived;
  uint64_t* total;

  template <class Block>
  void operator()(Block& block) const {
    PerLane<Block, Pair> x;
    block.privately([&](uint32_t lane) {
      const uint32_t v = values[block.index() * kLanes + lane];
      x[lane] = {v, 3 * v + 1};
    });
    const Pair sum = sum_over_block(block, x, block.shared().warps);
    const Pair scanned = scan_block(block, x, block.shared().warps);
    block.each([&](uint32_t lane) {
      ranks[block.index() * kLanes + lane] = x[lane];
      if (lane == 5) sums[block.index()] = sum, scanned_sums[block.index()] = scanned;
    });
    if (!is_last_block(block, arrived, block.shared().last)) return;
    block.each([&](uint32_t lane) {
      for (uint32_t i = 0; lane == 0 && i < block.count(); ++i) *total += sums[i].a;
    });
  }
};

TEST(Grid, SumsRanksAndTheLastBlock) {
  constexpr uint32_t kBlocks = 7, kCount = kBlocks * RankKernel::kLanes;
  std::mt19937 random(5);
  std::vector<uint32_t> values(kCount);
  for (uint32_t& v : values) v = static_cast<uint32_t>(random() % 1000);
  for (const LaneOrder order : kOrders) {
    std::vector<Pair> ranks(kCount), sums(kBlocks), scanned(kBlocks);
    uint32_t arrived = 0;
    uint64_t total = 0;
    run_emulated(kBlocks,
                 RankKernel{{values.data(), kCount},
                            {ranks.data(), kCount},
                            {sums.data(), kBlocks},
                            {scanned.data(), kBlocks},
                            &arrived,
                            &total},
                 order);
    for (uint32_t b = 0; b < kBlocks; ++b) {
      Pair before = {0, 0};
      for (uint32_t i = b * RankKernel::kLanes; i < (b + 1) * RankKernel::kLanes; ++i) {
        ASSERT_EQ(ranks[i].a, before.a) << i;
        ASSERT_EQ(ranks[i].b, before.b) << i;
        before = before + Pair{values[i], 3 * values[i] + 1};
      }
      EXPECT_EQ(sums[b].a, before.a);
      EXPECT_EQ(scanned[b].b, before.b);
    }
    EXPECT_EQ(total, std::accumulate(values.begin(), values.end(), uint64_t{0}));
    EXPECT_EQ(arrived, 0u);
  }
}

/// A lane reads what another one writes, without a barrier: what the emulation is there to find.
struct RacingKernel {
  static constexpr uint32_t kLanes = 32;
  using Shared = NoShared;
  View<uint32_t> cells;

  template <class Block>
  void operator()(Block& block) const {
    block.each([&](uint32_t lane) { cells[lane] = lane > 0 ? cells[lane - 1] + 1 : 1; });
  }
};
TEST(Grid, TheOrderOfLanesShowsARace) {
  uint32_t results[2] = {};
  for (int i = 0; i < 2; ++i) {
    std::vector<uint32_t> cells(32, 0);
    run_emulated(1, RacingKernel{{cells.data(), 32}}, i == 0 ? LaneOrder::rising : LaneOrder::falling);
    results[i] = cells[31];
  }
  EXPECT_NE(results[0], results[1]);
}

/// Steps of depth that lead both ways, one way, and not at all.
std::vector<float> terraces(int32_t rows, int32_t cols, float theta, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<float> depth_m(static_cast<size_t>(rows * cols), 1.0f);
  const float step[] = {1.0f, 1.0f + 0.5f * theta, 1.0f + 1.004f * theta, 1.0f - 0.998f * theta, 1.3f, 0.0f};
  for (float& z : depth_m) {
    const auto draw = static_cast<uint32_t>(random() % 16);
    z = draw < 8    ? step[0]
        : draw < 10 ? step[1]
        : draw < 12 ? step[2]
        : draw < 14 ? step[3]
                    : step[draw - 10];
  }
  return depth_m;
}

TEST(ConnectedRegions, AreWhatTheFloodFillFinds) {
  constexpr int32_t kRows = 45, kCols = 63;
  constexpr float kTheta = 0.02f;
  constexpr auto kPixels = static_cast<uint32_t>(kRows * kCols);
  for (uint32_t seed = 0; seed < 12; ++seed) {
    std::vector<float> depth_m = terraces(kRows, kCols, kTheta, seed);
    std::vector<uint8_t> seeds(kPixels, 0);
    std::mt19937 random(100 + seed);
    for (int i = 0; i < 6; ++i) seeds[random() % kPixels] = kMasked;
    std::vector<uint8_t> expected = seeds;
    std::vector<int32_t> queue(kPixels);
    const ImageView<const float> depth{depth_m.data(), kRows, kCols, kCols};
    flood_fill({expected.data(), kRows, kCols, kCols}, depth, kTheta, {queue.data(), kPixels});
    uint32_t one_way = 0;
    for (const LaneOrder order : kOrders) {
      std::vector<int32_t> parent(kPixels);
      std::vector<uint8_t> reached(kPixels), mask = seeds;
      std::vector<OneWayStep> steps(2 * kPixels);
      const ComponentMemory memory{
          {parent.data(), kPixels}, {reached.data(), kPixels}, {steps.data(), 2 * kPixels}};
      const ImageView<uint8_t> image{mask.data(), kRows, kCols, kCols};
      run_emulated(3, StartComponentsKernel{memory, &one_way}, order);
      run_emulated(3, UniteKernel{memory, depth, kTheta, &one_way}, order);
      run_emulated(3, SeedKernel{memory, image, depth}, order);
      run_emulated(1, FollowStepsKernel{memory, &one_way}, order);
      run_emulated(3, GrowMaskKernel{memory, image, depth}, order);
      ASSERT_EQ(mask, expected) << "seed " << seed;
    }
    EXPECT_GT(one_way, 20u);  // the scene has what it is there to show
  }
}

TEST(Slide, ErodesAndDilatesAsTheCpuDoes) {
  constexpr int32_t kRows = 31, kCols = 47;
  std::mt19937 random(3);
  std::vector<uint8_t> in(static_cast<size_t>(kRows * kCols));
  for (uint8_t& p : in) p = random() % 12 ? kMasked : uint8_t{0};
  const ImageView<const uint8_t> image{in.data(), kRows, kCols, kCols};
  std::vector<uint8_t> expected(in.size()), got(in.size());
  const ImageView<uint8_t> a{expected.data(), kRows, kCols, kCols}, b{got.data(), kRows, kCols, kCols};
  for (const int32_t radius : {0, 1, 3, 40}) {
    erode_rows(image, a, radius, 0, kRows);
    run_emulated(2, SlideKernel<true>{image, b, radius, true}, LaneOrder::shuffled);
    ASSERT_EQ(got, expected) << radius;
    erode_columns(image, a, radius, 0, kCols);
    run_emulated(2, SlideKernel<true>{image, b, radius, false}, LaneOrder::shuffled);
    ASSERT_EQ(got, expected) << radius;
    dilate_rows(image, a, radius, 0, kRows);
    run_emulated(2, SlideKernel<false>{image, b, radius, true}, LaneOrder::shuffled);
    ASSERT_EQ(got, expected) << radius;
    dilate_columns(image, a, radius, 0, kCols);
    run_emulated(2, SlideKernel<false>{image, b, radius, false}, LaneOrder::shuffled);
    ASSERT_EQ(got, expected) << radius;
  }
}

TEST(CudaEngine, SaysWhyItCannotBeHad) {
  EngineParams params;
  params.camera.k = {500, 500, 159.5f, 119.5f, 320, 240};
  params.map.pool_blocks = 1000;
  const MemoryItems plan = plan_cuda_engine(params);
  uint64_t sum = 0;
  for (uint32_t i = 0; i < plan.count; ++i) sum += plan.item[i].bytes;
  EXPECT_EQ(sum, plan.total_bytes);
  EXPECT_EQ(plan.total_bytes > 1000 * 4096, cuda_is_built());
  const char* missing = cuda_missing();
  EXPECT_EQ(make_cuda_engine(params) == nullptr, missing != nullptr);
  if (missing) {
    EXPECT_STRNE(missing, "");
  }
}

}  // namespace
}  // namespace stillmap
