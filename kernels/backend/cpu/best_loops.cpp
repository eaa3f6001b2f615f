#include <cstdlib>
#include <cstring>

#include "kernels/backend/cpu/loops.hpp"

namespace stillmap {

View<const CpuLoops* const> runnable_loops() {
  static const CpuLoops* tables[3];
  static const uint32_t count = [] {
    uint32_t n = 0;
#if defined(__x86_64__)
    const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512cd"))
      tables[n++] = &kLoopsAvx512;
    if (avx2) tables[n++] = &kLoopsAvx2;
#endif
    tables[n++] = &kLoopsBaseline;
    return n;
  }();
  return {tables, count};
}

const CpuLoops& best_loops() {
  const char* asked = std::getenv("STILLMAP_ISA");
  for (const CpuLoops* table : runnable_loops())
    if (asked && std::strcmp(asked, table->name) == 0) return *table;
  return *runnable_loops()[0];
}

}  // namespace stillmap
