#include "firmware-like/commands/engines.hpp"
#include "firmware-like/journal.hpp"

#include <cstdio>

namespace stillmap {

std::string pick_device(const std::string& wanted, bool quiet) {
  if (wanted != "auto") return wanted;
  const char* missing = cuda_missing();
  if (!cuda_is_built() || quiet) return "cpu";
  if (missing)
    say(Priority::info, std::string("no CUDA device (") + missing + "); the CPU engine runs");
  else  // until toolchain/gpu_check.sh has passed on a device
    say(Priority::info,
        "the CPU engine runs; the CUDA engine has not been proven yet, --device cuda takes it");
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
