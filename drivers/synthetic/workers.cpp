#include "drivers/synthetic/workers.hpp"

#include <algorithm>

namespace stillmap::synthetic {

Workers::Workers(int threads) {
  const int helpers = std::clamp(threads, 1, 64) - 1;
  helpers_.reserve(static_cast<size_t>(helpers));
  for (int i = 0; i < helpers; ++i) helpers_.emplace_back([this] { help(); });
}

Workers::~Workers() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  start_.notify_all();
  for (std::thread& t : helpers_) t.join();
}

void Workers::run_erased(int32_t pieces, Call call, const void* body) {
  {
    const std::lock_guard lock(mutex_);
    call_ = call;
    body_ = body;
    pieces_ = pieces;
    next_.store(0, std::memory_order_relaxed);
    busy_ = static_cast<int>(helpers_.size());
    ++round_;
  }
  start_.notify_all();
  work_off();
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return busy_ == 0; });
}

void Workers::work_off() {
  for (int32_t piece; (piece = next_.fetch_add(1, std::memory_order_relaxed)) < pieces_;) call_(body_, piece);
}

void Workers::help() {
  uint64_t seen = 0;
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      start_.wait(lock, [&] { return stop_ || round_ != seen; });
      if (stop_) return;
      seen = round_;
    }
    work_off();
    const std::lock_guard lock(mutex_);
    if (--busy_ == 0) done_.notify_one();
  }
}

}  // namespace stillmap::synthetic
