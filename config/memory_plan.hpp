#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/group_record.hpp"

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

/// Frames that the runtime holds: one being filled, one being processed.
inline constexpr uint64_t kFrameSlots = 2;

/// Pieces of a map that is being saved, between the loop and the thread that writes.
inline constexpr uint32_t kMapSaveChunks = 4;
/// A piece is full when it holds as much; also what a frame copies at most, but for one more group.
inline constexpr uint32_t kMapSaveChunkBytes = 512 * 1024;
/// What saving takes, a largest group over the size of a piece included. @param groups Engine::group_capacity
constexpr uint64_t map_save_bytes(uint64_t groups) {
  constexpr uint64_t kLargestRecord = kMaxGroupRecordBytes + sizeof(uint32_t);
  return kMapSaveChunks * (kMapSaveChunkBytes + kLargestRecord) + groups * sizeof(BlockKey);
}

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
