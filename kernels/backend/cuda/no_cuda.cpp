// In place of engine_cuda.cu where the program is built without nvcc.

#include "kernels/engine.hpp"

namespace stillmap {

bool cuda_is_built() {
  return false;
}
const char* cuda_missing() {
  return "this build has no CUDA engine";
}
MemoryItems plan_cuda_engine(const EngineParams&) {
  return {};
}
std::unique_ptr<Engine> make_cuda_engine(const EngineParams&) {
  return nullptr;
}

}  // namespace stillmap
