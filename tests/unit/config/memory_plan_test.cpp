#include "config/memory_plan.hpp"

#include <gtest/gtest.h>

namespace stillmap {

/// Stands for the engine's: the linker takes it before it looks into the engine's library.
MemoryItems plan_cpu_engine(const EngineParams& params) {
  MemoryItems items;
  items.item[0] = {"voxel blocks", 4096 * static_cast<uint64_t>(params.map.pool_blocks)};
  items.item[1] = {"intensity", static_cast<uint64_t>(params.camera.k.width * params.camera.k.height) * 4};
  items.count = 2;
  items.total_bytes = items.item[0].bytes + items.item[1].bytes;
  return items;
}

namespace {

MemoryItems items() {
  MemoryItems items;
  items.item[0] = {"voxel blocks", 400000000};
  items.item[1] = {"block table", 4194304};
  items.count = 2;
  items.total_bytes = 404194304;
  return items;
}

const CameraModel kVga = {{585, 585, 320, 240, 640, 480}, {}};

TEST(MemoryPlan, AddsTheFramesWithDepthColourAndMasks) {
  const MemoryPlan plan = memory_plan(Config{}, kVga, items());
  const uint64_t frames = 6 * 640 * 480 * (2 + 3 + 1 + 1);  // runtime.frame_slots
  EXPECT_EQ(plan.total_bytes, items().total_bytes + frames);
  uint64_t sum = 0;
  for (const MemoryPool& pool : plan.pools) sum += pool.bytes;
  EXPECT_EQ(sum, plan.total_bytes);
  EXPECT_EQ(plan.budget_bytes, 512000000u);
}

TEST(MemoryPlan, AsksTheEngineWithThisConfigurationAndCamera) {
  Config config;
  config.map.pool_blocks = 1000;
  const MemoryPlan plan = memory_plan(config, kVga, 1000.0f);
  ASSERT_GE(plan.pools.size(), 2u);
  EXPECT_EQ(plan.pools[0].bytes, 4096u * 1000);
  EXPECT_EQ(plan.pools[1].bytes, 640u * 480 * 4);
}

TEST(MemoryPlan, TableShowsEveryPoolTotalAndBudget) {
  const MemoryPlan plan = memory_plan(Config{}, kVga, items());
  const std::string text = table(plan);
  for (const MemoryPool& pool : plan.pools) {
    EXPECT_NE(text.find(pool.name), std::string::npos);
    EXPECT_NE(text.find(std::to_string(pool.bytes)), std::string::npos);
  }
  EXPECT_NE(text.find("total"), std::string::npos);
  EXPECT_NE(text.find(std::to_string(plan.total_bytes)), std::string::npos);
  EXPECT_NE(text.find("512000000"), std::string::npos);
}

TEST(MemoryPlan, OverTheBudgetIsAnErrorWithTheTable) {
  Config config;
  EXPECT_TRUE(check_budget(memory_plan(config, kVga, items())));
  config.memory.budget_mb = 400;
  const MemoryPlan plan = memory_plan(config, kVga, items());
  const Result<Done> checked = check_budget(plan);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error_kind(), ErrorKind::bad_usage);
  EXPECT_NE(checked.error().find("memory.budget_mb = 400"), std::string::npos) << checked.error();
  EXPECT_NE(checked.error().find(table(plan)), std::string::npos);
}

}  // namespace
}  // namespace stillmap
