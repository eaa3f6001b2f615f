#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace stillmap {

/// Workers made at boot; the calling thread works too. Work is a run of indices handed out one by one, so
/// which thread does which index varies, but never what an index does: results must not depend on the thread.
class ThreadPool {
 public:
  /// @param threads 1..64, the caller included; cut to that
  /// @param on_worker called by each worker, with true when it starts and with false before it ends; may be
  /// null
  /// @thread boot
  explicit ThreadPool(int32_t threads, void (*on_worker)(bool starts) = nullptr);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int32_t threads() const { return static_cast<int32_t>(workers_.size()) + 1; }

  /// Calls `f(i)` for i in [0, count), in any order, on all threads; returns when all are done. Allocates
  /// nothing.
  /// @thread one at a time
  template <class F>
  void for_each(uint32_t count, const F& f) {
    run(
        count, [](const void* context, uint32_t i) { (*static_cast<const F*>(context))(i); }, &f);
  }

 private:
  using Call = void (*)(const void* context, uint32_t index);

  void run(uint32_t count, Call call, const void* context);
  void work();
  void worker_loop();

  // The job; written by the caller before `generation_` moves, read by workers after.
  Call call_ = nullptr;
  const void* context_ = nullptr;
  uint32_t count_ = 0;
  alignas(64) std::atomic<uint32_t> next_{0};
  alignas(64) std::atomic<uint32_t> generation_{0};
  alignas(64) std::atomic<uint32_t> busy_{0};  ///< workers that have not finished the job
  std::atomic<bool> stopping_{false};
  std::vector<std::thread> workers_;
};

}  // namespace stillmap
