#include "kernels/backend/cpu/thread_pool.hpp"

#include <algorithm>

namespace stillmap {

ThreadPool::ThreadPool(int32_t threads, void (*on_worker)(bool starts)) {
  constexpr int32_t kMost = 64;
  for (int32_t i = 1; i < std::min(threads, kMost); ++i)
    workers_.emplace_back([this, on_worker] {
      if (on_worker != nullptr) on_worker(true);
      worker_loop();
      if (on_worker != nullptr) on_worker(false);
    });
}

ThreadPool::~ThreadPool() {
  stopping_ = true;
  generation_.fetch_add(1);
  generation_.notify_all();
  for (std::thread& w : workers_) w.join();
}

void ThreadPool::run(uint32_t count, Call call, const void* context) {
  if (workers_.empty() || count <= 1) {
    for (uint32_t i = 0; i < count; ++i) call(context, i);
    return;
  }
  call_ = call;
  context_ = context;
  count_ = count;
  next_ = 0;
  busy_ = static_cast<uint32_t>(workers_.size());
  generation_.fetch_add(1);
  generation_.notify_all();
  work();
  for (uint32_t left = busy_.load(); left != 0; left = busy_.load()) busy_.wait(left);
}

void ThreadPool::work() {
  for (uint32_t i = next_.fetch_add(1); i < count_; i = next_.fetch_add(1)) call_(context_, i);
}

void ThreadPool::worker_loop() {
  uint32_t seen = 0;
  while (true) {
    generation_.wait(seen);
    seen = generation_.load();
    if (stopping_) return;
    work();
    if (busy_.fetch_sub(1) == 1) busy_.notify_one();
  }
}

}  // namespace stillmap
