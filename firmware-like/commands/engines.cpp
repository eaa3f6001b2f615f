#include "firmware-like/commands/engines.hpp"

#include <cstdio>

namespace stillmap {

std::string pick_device(const std::string& wanted, bool quiet) {
  if (wanted == "cpu") return "cpu";
  const char* missing = cuda_missing();
  if (!missing) return "cuda";
  if (cuda_is_built() && !quiet)
    std::fprintf(stderr, "stillmap: no CUDA device (%s); the CPU engine runs\n", missing);
  return "cpu";
}

std::string cuda_refused(const std::string& wanted) {
  const char* missing = wanted == "cuda" ? cuda_missing() : nullptr;
  if (!missing) return {};
  return std::string("--device cuda: ") + missing + "; use --device auto or --device cpu";
}

MemoryItems plan_engine(const std::string& device, const EngineParams& params) {
  return device == "cuda" ? plan_cuda_engine(params) : plan_cpu_engine(params);
}

std::unique_ptr<Engine> make_engine(const std::string& device, const EngineParams& params) {
  return device == "cuda" ? make_cuda_engine(params) : make_cpu_engine(params);
}

}  // namespace stillmap
