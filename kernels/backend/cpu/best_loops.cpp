#include <cstdlib>
#include <cstring>

#include "kernels/backend/cpu/loops.hpp"

namespace stillmap {

const CpuLoops& best_loops() {
  const char* asked = std::getenv("STILLMAP_ISA");
  if (asked && std::strcmp(asked, kLoopsBaseline.name) == 0) return kLoopsBaseline;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return kLoopsAvx2;
#endif
  return kLoopsBaseline;
}

}  // namespace stillmap
