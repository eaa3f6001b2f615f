#include "config/memory_plan.hpp"

#include <fmt/format.h>

#include "config/engine_params.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {
namespace {

constexpr uint64_t kBytesPerMb = 1000000;

double megabytes(uint64_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(kBytesPerMb);
}

}  // namespace

void MemoryPlan::add(std::string name, uint64_t bytes) {
  pools.push_back({std::move(name), bytes});
  total_bytes += bytes;
}

MemoryPlan memory_plan(const Config& config, const CameraModel& camera, const MemoryItems& engine) {
  MemoryPlan plan;
  for (uint32_t i = 0; i < engine.count; ++i) plan.add(engine.item[i].name, engine.item[i].bytes);
  const uint64_t pixels = static_cast<uint64_t>(camera.k.width) * static_cast<uint64_t>(camera.k.height);
  const auto slots = static_cast<uint64_t>(config.runtime.frame_slots);
  plan.add("frame slots: depth", slots * pixels * sizeof(uint16_t));
  plan.add("frame slots: colour", slots * pixels * sizeof(Rgb8));
  plan.add("frame slots: masks", 2 * slots * pixels * sizeof(uint8_t));
  plan.budget_bytes = static_cast<uint64_t>(config.memory.budget_mb) * kBytesPerMb;
  return plan;
}

MemoryPlan memory_plan(const Config& config, const CameraModel& camera, float depth_units_per_m) {
  return memory_plan(config, camera, plan_cpu_engine(engine_params(config, camera, depth_units_per_m)));
}

std::string table(const MemoryPlan& plan) {
  std::string text = fmt::format("{:<32} {:>14} {:>10}\n", "pool", "bytes", "MB");
  const auto line = [&](const std::string& name, uint64_t bytes) {
    text += fmt::format("{:<32} {:>14} {:>10.1f}\n", name, bytes, megabytes(bytes));
  };
  for (const MemoryPool& pool : plan.pools) line(pool.name, pool.bytes);
  line("total", plan.total_bytes);
  line("budget (memory.budget_mb)", plan.budget_bytes);
  return text;
}

Result<Done> check_budget(const MemoryPlan& plan) {
  if (plan.fits()) return Done{};
  return Error{
      fmt::format(
          "the memory plan of {:.1f} MB is over memory.budget_mb = {:.0f}: make map.pool_blocks smaller "
          "or the budget larger\n{}",
          megabytes(plan.total_bytes), megabytes(plan.budget_bytes), table(plan)),
      ErrorKind::bad_usage};
}

}  // namespace stillmap
