#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "kernels/engine.hpp"

namespace stillmap {

struct MemoryPool {
  std::string name;
  uint64_t bytes = 0;
};

/// All memory that a run takes at boot and keeps.
struct MemoryPlan {
  std::vector<MemoryPool> pools;
  uint64_t total_bytes = 0;
  uint64_t budget_bytes = 0;

  void add(std::string name, uint64_t bytes);
  bool fits() const { return total_bytes <= budget_bytes; }
};

/// The engine's pools as `plan_cpu_engine` counts them, the frame slots, and memory.budget_mb (10^6 bytes
/// each).
/// @param camera with its size, pixels  @param depth_units_per_m of the source
/// @thread boot; allocates nothing of the plan
MemoryPlan memory_plan(const Config& config, const CameraModel& camera, float depth_units_per_m);

/// The same from an engine's plan that is at hand.
MemoryPlan memory_plan(const Config& config, const CameraModel& camera, const MemoryItems& engine);

/// A line for each pool with its bytes, then total and budget.
std::string table(const MemoryPlan& plan);

/// @return an error of kind bad_usage that holds the table when the plan is over its budget
Result<Done> check_budget(const MemoryPlan& plan);

}  // namespace stillmap
