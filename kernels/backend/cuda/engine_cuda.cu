// The engine of the GPU: the device, and DeviceEngine over it.

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <thread>
#include <utility>

#include "kernels/backend/cuda/cuda_device.cuh"
#include "kernels/backend/cuda/device_engine.hpp"

namespace stillmap {

CudaDevice::~CudaDevice() {
  // What fails here has failed before, or the process ends anyway.
  for (cudaGraphExec_t step : steps_)
    if (step) cudaGraphExecDestroy(step);
  if (stream_) cudaStreamDestroy(stream_);
  if (device_memory_) cudaFree(device_memory_);
  if (shared_memory_) cudaFreeHost(shared_memory_);
}

bool CudaDevice::open(uint64_t device_bytes, uint64_t shared_bytes) {
  void* memory = nullptr;
  if (!check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking))) return false;
  if (!check(cudaMalloc(&memory, device_bytes))) return false;
  device_memory_ = static_cast<uint8_t*>(memory);
  // Mapped: kernels read the images where the host has put them. On a GPU that shares its memory with the
  // host that is no copy at all, on others one over the bus.
  if (!check(cudaHostAlloc(&memory, shared_bytes, cudaHostAllocMapped))) return false;
  shared_memory_ = static_cast<uint8_t*>(memory);
  // With unified addressing, which every 64-bit platform has, both sides use the same address.
  void* on_device = nullptr;
  if (!check(cudaHostGetDevicePointer(&on_device, memory, 0))) return false;
  if (on_device != memory) return check(cudaErrorNotSupported);
  std::memset(shared_memory_, 0, shared_bytes);
  fill(device_memory_, 0, device_bytes);
  return wait() == Status::ok;
}

void CudaDevice::copy(void* to, const void* from, uint64_t bytes) {
  if (!failed() && bytes > 0) check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDefault, stream_));
}

void CudaDevice::fill(void* at, uint8_t byte, uint64_t bytes) {
  if (!failed() && bytes > 0) check(cudaMemsetAsync(at, byte, bytes, stream_));
}

bool CudaDevice::begin_recording(uint32_t step) {
  if (step >= kMostSteps) return check(cudaErrorInvalidValue);
  return !failed() && check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
}

void CudaDevice::end_recording(uint32_t step) {
  cudaGraph_t graph = nullptr;
  check(
      cudaStreamEndCapture(stream_, &graph));  // also after an error, which would leave the stream capturing
  if (graph && !failed() && check(cudaGraphInstantiate(&steps_[step], graph, 0)))
    check(cudaGraphUpload(steps_[step], stream_));
  if (graph) cudaGraphDestroy(graph);
  wait();
}

void CudaDevice::play(uint32_t step) {
  if (!failed()) check(cudaGraphLaunch(steps_[step], stream_));
}

/// Asks instead of blocking in the driver: a GPU that hangs must not take the real-time thread with it.
Status CudaDevice::wait() {
  using Clock = std::chrono::steady_clock;
  constexpr auto kLongest = std::chrono::seconds(5);
  const Clock::time_point start = Clock::now();
  while (!failed()) {
    const cudaError_t result = cudaStreamQuery(stream_);
    if (result == cudaSuccess) break;
    if (result != cudaErrorNotReady)
      check(result);
    else if (Clock::now() - start > kLongest)
      check(cudaErrorLaunchTimeout);
    else
      std::this_thread::yield();
  }
  return failed() ? Status::unavailable : Status::ok;
}

namespace {

/// DeviceEngine with the device that it uses. The device goes first, but the engine asks nothing of it then.
class CudaEngine final : public DeviceEngine<CudaDevice> {
 public:
  CudaEngine(const EngineParams& params, std::unique_ptr<CudaDevice> device)
      : DeviceEngine<CudaDevice>(params, *device), owned_(std::move(device)) {}

 private:
  std::unique_ptr<CudaDevice> owned_;
};

}  // namespace

bool cuda_is_built() {
  return true;
}

const char* cuda_missing() {
  // All kernels are loaded at boot: a frame must not wait for one, nor allocate for it.
  setenv("CUDA_MODULE_LOADING", "EAGER", 0);
  int devices = 0;  // not written by all errors
  const cudaError_t result = cudaGetDeviceCount(&devices);
  if (result != cudaSuccess) return cudaGetErrorString(result);
  return devices > 0 ? nullptr : "there is no device";
}

MemoryItems plan_cuda_engine(const EngineParams& params) {
  MemoryItems shared;
  MemoryItems all = DeviceEngine<CudaDevice>::plan(params, shared);
  for (uint32_t i = 0; i < shared.count; ++i) all.item[all.count++] = shared.item[i];
  all.total_bytes += shared.total_bytes;
  return all;
}

std::unique_ptr<Engine> make_cuda_engine(const EngineParams& params) {
  if (cuda_missing()) return nullptr;
  std::unique_ptr<CudaDevice> device(new (std::nothrow) CudaDevice);
  MemoryItems shared;
  const MemoryItems own = DeviceEngine<CudaDevice>::plan(params, shared);
  if (!device || !device->open(own.total_bytes, shared.total_bytes)) return nullptr;
  std::unique_ptr<CudaEngine> engine(new (std::nothrow) CudaEngine(params, std::move(device)));
  if (!engine || engine->failed()) return nullptr;
  return engine;
}

}  // namespace stillmap
