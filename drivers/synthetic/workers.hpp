#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

namespace stillmap::synthetic {

/// Threads made once; `run` hands out numbered pieces of work to them and to the caller.
class Workers {
 public:
  /// @param threads 1..64, the calling thread included
  explicit Workers(int threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int threads() const { return static_cast<int>(helpers_.size()) + 1; }

  /// Calls body(piece) once for each piece in 0..pieces-1, in any order, on any thread; returns when all are
  /// done.
  /// @thread one caller at a time
  template <class Body>
  void run(int32_t pieces, const Body& body) {
    run_erased(
        pieces, [](const void* b, int32_t piece) { (*static_cast<const Body*>(b))(piece); }, &body);
  }

 private:
  using Call = void (*)(const void* body, int32_t piece);

  void run_erased(int32_t pieces, Call call, const void* body);
  void help();
  void work_off();

  std::mutex mutex_;
  std::condition_variable start_, done_;
  uint64_t round_ = 0;
  int busy_ = 0;
  bool stop_ = false;
  Call call_ = nullptr;
  const void* body_ = nullptr;
  int32_t pieces_ = 0;
  std::atomic<int32_t> next_{0};
  std::vector<std::thread> helpers_;
};

}  // namespace stillmap::synthetic
