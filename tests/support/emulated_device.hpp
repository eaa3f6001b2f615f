#pragma once

// The device of kernels/backend/cuda/device_engine.hpp on the CPU.

#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>

#include "kernels/backend/cuda/device_engine.hpp"
#include "tests/support/emulated_grid.hpp"

namespace stillmap {

class EmulatedDevice {
 public:
  EmulatedDevice(uint64_t device_bytes, uint64_t shared_bytes, LaneOrder order)
      : device_(take(device_bytes)), shared_(take(shared_bytes)), order_(order) {}

  bool failed() const { return broken_; }
  uint8_t* device_memory() { return device_.get(); }
  uint8_t* shared_memory() { return shared_.get(); }

  template <class Kernel>
  void launch(uint32_t blocks, const Kernel& kernel) {
    ++launches_;
    if (!broken_) run_emulated(blocks, kernel, order_);
  }
  void copy(void* to, const void* from, uint64_t bytes) {
    if (!broken_ && bytes > 0) std::memcpy(to, from, bytes);
  }
  void fill(void* at, uint8_t byte, uint64_t bytes) {
    if (!broken_ && bytes > 0) std::memset(at, byte, bytes);
  }
  void record(uint32_t step, std::function<void()> f) { steps_[step] = std::move(f); }
  void play(uint32_t step) { steps_.at(step)(); }
  Status wait() { return broken_ ? Status::unavailable : Status::ok; }

  /// From now on it answers like a device that was lost.
  void lose() { broken_ = true; }
  uint32_t launches() const { return launches_; }

 private:
  struct Free {
    void operator()(uint8_t* memory) const { std::free(memory); }
  };
  using Memory = std::unique_ptr<uint8_t, Free>;
  static Memory take(uint64_t bytes) {
    constexpr uint64_t kPage = 4096;
    const uint64_t whole = (bytes + kPage - 1) / kPage * kPage;
    auto* const memory = static_cast<uint8_t*>(std::aligned_alloc(kPage, whole));
    std::memset(memory, 0, whole);
    return Memory(memory);
  }

  Memory device_, shared_;
  LaneOrder order_;
  std::map<uint32_t, std::function<void()>> steps_;
  bool broken_ = false;
  uint32_t launches_ = 0;
};

/// An engine with its own emulated device.
class EmulatedEngine {
 public:
  explicit EmulatedEngine(const EngineParams& params, LaneOrder order = LaneOrder::rising) {
    MemoryItems shared;
    const MemoryItems own = DeviceEngine<EmulatedDevice>::plan(params, shared);
    device_ = std::make_unique<EmulatedDevice>(own.total_bytes, shared.total_bytes, order);
    engine_ = std::make_unique<DeviceEngine<EmulatedDevice>>(params, *device_);
  }
  Engine& engine() { return *engine_; }
  EmulatedDevice& device() { return *device_; }

 private:
  std::unique_ptr<EmulatedDevice> device_;
  std::unique_ptr<DeviceEngine<EmulatedDevice>> engine_;
};

}  // namespace stillmap
