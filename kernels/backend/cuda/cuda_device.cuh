#pragma once

// The GPU as the device of device_engine.hpp. Everything goes through one stream, never the default one;
// every call is checked. An error stays: whatever is asked afterwards is answered `unavailable`.

#include <cuda_runtime.h>

#include <cstdint>
#include <cstdio>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/base/status.hpp"

namespace stillmap {

/// A thread block; see grid.hpp.
template <class Kernel>
class CudaBlock {
 public:
  static constexpr uint32_t kLanes = Kernel::kLanes;
  static_assert(kLanes % kWarp == 0 && kLanes <= 1024);

  /// A value in registers: a lane has its own only, whatever the index.
  template <class T>
  class PerLane {
   public:
    __device__ T& operator[](uint32_t) { return value_; }
    __device__ const T& operator[](uint32_t) const { return value_; }

   private:
    T value_{};
  };

  __device__ explicit CudaBlock(typename Kernel::Shared& shared) : shared_(shared) {}

  __device__ uint32_t index() const { return blockIdx.x; }
  __device__ uint32_t count() const { return gridDim.x; }
  __device__ typename Kernel::Shared& shared() const { return shared_; }
  __device__ void fence() const { __threadfence(); }

  template <class F>
  __device__ void each(const F& f) const {
    f(threadIdx.x);
    __syncthreads();
  }
  template <class F>
  __device__ void privately(const F& f) const {
    f(threadIdx.x);
  }
  template <class T>
  __device__ PerLane<T> shuffle_down(const PerLane<T>& x, uint32_t n) const {
    return shuffled(x, [n](uint32_t word) { return __shfl_down_sync(kAll, word, n); });
  }
  template <class T>
  __device__ PerLane<T> shuffle_up(const PerLane<T>& x, uint32_t n) const {
    return shuffled(x, [n](uint32_t word) { return __shfl_up_sync(kAll, word, n); });
  }
  __device__ PerLane<uint32_t> ballot(const PerLane<uint32_t>& x) const {
    PerLane<uint32_t> bits;
    bits[0] = __ballot_sync(kAll, x[0] != 0);
    return bits;
  }

 private:
  static constexpr uint32_t kAll = 0xffffffffu;

  /// Word by word, as the instruction has it.
  template <class T, class Shuffle>
  __device__ static PerLane<T> shuffled(const PerLane<T>& x, const Shuffle& shuffle) {
    static_assert(sizeof(T) % sizeof(uint32_t) == 0);
    constexpr uint32_t kWords = sizeof(T) / sizeof(uint32_t);
    uint32_t words[kWords];
    memcpy(words, &x[0], sizeof words);
#pragma unroll
    for (uint32_t i = 0; i < kWords; ++i) words[i] = shuffle(words[i]);
    PerLane<T> out;
    memcpy(&out[0], words, sizeof words);
    return out;
  }

  typename Kernel::Shared& shared_;
};

template <class Kernel>
__global__ void __launch_bounds__(Kernel::kLanes) run_kernel(const __grid_constant__ Kernel kernel) {
  // Plain bytes: memory that blocks share cannot be initialised.
  __shared__ alignas(16) unsigned char shared[sizeof(typename Kernel::Shared)];
  CudaBlock<Kernel> block(*reinterpret_cast<typename Kernel::Shared*>(shared));
  kernel(block);
}

class CudaDevice {
 public:
  CudaDevice() = default;
  ~CudaDevice();
  CudaDevice(const CudaDevice&) = delete;
  CudaDevice& operator=(const CudaDevice&) = delete;

  /// Takes the memory, zeroed, and a stream. @return false: it cannot be had.  @thread boot
  bool open(uint64_t device_bytes, uint64_t shared_bytes);

  bool failed() const { return error_ != cudaSuccess; }
  /// "" while nothing has failed.
  const char* error() const { return failed() ? cudaGetErrorString(error_) : ""; }
  uint8_t* device_memory() const { return device_memory_; }
  uint8_t* shared_memory() const { return shared_memory_; }

  template <class Kernel>
  void launch(uint32_t blocks, const Kernel& kernel) {
    static_assert(sizeof(Kernel) <= 4000, "what a launch takes with it");
    if (failed()) return;
    run_kernel<Kernel><<<blocks, Kernel::kLanes, 0, stream_>>>(kernel);
    check(cudaGetLastError());
  }
  void copy(void* to, const void* from, uint64_t bytes);
  void fill(void* at, uint8_t byte, uint64_t bytes);

  /// @thread boot
  template <class F>
  void record(uint32_t step, const F& f) {
    if (!begin_recording(step)) return;
    f();
    end_recording(step);
  }
  void play(uint32_t step);
  Status wait();

 private:
  static constexpr uint32_t kMostSteps = 16;

  bool check(cudaError_t result) {
    if (result != cudaSuccess && error_ == cudaSuccess) error_ = result;
    return error_ == cudaSuccess;
  }
  bool begin_recording(uint32_t step);
  void end_recording(uint32_t step);

  cudaError_t error_ = cudaSuccess;
  cudaStream_t stream_ = nullptr;
  uint8_t* device_memory_ = nullptr;
  uint8_t* shared_memory_ = nullptr;
  cudaGraphExec_t steps_[kMostSteps] = {};
};

}  // namespace stillmap
