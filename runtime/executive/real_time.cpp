#include "runtime/executive/real_time.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstring>

#include "config/cpu_set.hpp"

namespace stillmap {
namespace {

static_assert(kMostCpus <= CPU_SETSIZE);

std::string refused(const char* thread, const std::string& what, int error) {
  return std::string(thread) + ": " + what + ": " + std::strerror(error);
}

[[gnu::noinline]] void touch_stack(uint32_t bytes) {
  constexpr uint32_t kPage = 4096;
  auto* const stack = static_cast<volatile char*>(__builtin_alloca(bytes));
  for (uint32_t i = 0; i < bytes; i += kPage) stack[i] = 0;
}

}  // namespace

std::vector<std::string> apply_to_this_thread(const ThreadPlan& plan, uint32_t stack_bytes) {
  std::vector<std::string> trouble;
  pthread_setname_np(pthread_self(), plan.name);
  if (!plan.cpus.empty()) {
    cpu_set_t set;
    CPU_ZERO(&set);
    for (const int32_t cpu : parse_cpus(plan.cpus)) CPU_SET(cpu, &set);
    if (const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set); error != 0)
      trouble.push_back(refused(plan.name, "CPU set " + plan.cpus, error));
  }
  if (plan.fifo_priority > 0) {
    sched_param param{};
    param.sched_priority = plan.fifo_priority;
    if (const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param); error != 0)
      trouble.push_back(refused(plan.name, "FIFO priority " + std::to_string(plan.fifo_priority), error));
  }
  touch_stack(stack_bytes);
  return trouble;
}

std::string lock_memory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return refused("memory", "locking it", errno);
}

}  // namespace stillmap
