#include "tests/parity/engines.hpp"

#include "kernels/backend/cpu/loops.hpp"

namespace stillmap::parity {
namespace {

NamedEngine cpu(const std::string& name, const Tolerance& tolerance, const CpuLoops& loops, int32_t threads) {
  return {name, tolerance, [&loops, threads](EngineParams params) {
            params.threads = threads;
            return make_cpu_engine(params, loops);
          }};
}

}  // namespace

std::vector<NamedEngine> available_engines() {
  std::vector<NamedEngine> engines = {
      cpu("cpu-baseline", kSameBits, kLoopsBaseline, 1),
      cpu("cpu-baseline-3-threads", kSameBits, kLoopsBaseline, 3),
  };
  for (const CpuLoops* loops : runnable_loops())
    if (loops != &kLoopsBaseline)
      engines.push_back(cpu(std::string("cpu-") + loops->name, kRounding, *loops, 2));
  if (!cuda_missing()) engines.push_back({"cuda", kRounding, make_cuda_engine});
  return engines;
}

std::string engines_left_out() {
  const char* missing = cuda_missing();
  return missing ? std::string("skip cuda: ") + missing : std::string();
}

}  // namespace stillmap::parity
