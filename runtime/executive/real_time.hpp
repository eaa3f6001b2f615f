#pragma once

// All that is asked of the system for real time: priorities, CPU sets, stacks, locked memory. What it refuses
// is said and gone without.

#include <cstdint>
#include <string>
#include <vector>

namespace stillmap {

/// How a thread runs.
struct ThreadPlan {
  const char* name;           ///< at most 15 characters: as `top -H` shows it
  int32_t fifo_priority = 0;  ///< SCHED_FIFO 1..99; 0: the usual scheduler
  std::string cpus;           ///< "0,2-3"; empty: any
};

/// Applies the plan to the calling thread and touches `stack_bytes` of its stack, so that no page of it is
/// missing later. @return what the system refused, one line each; empty: nothing.  @thread the one it is for
std::vector<std::string> apply_to_this_thread(const ThreadPlan& plan, uint32_t stack_bytes = 256 * 1024);

/// Keeps all memory, present and future, in RAM. @return empty, or what was refused.  @thread boot
std::string lock_memory();

}  // namespace stillmap
