#include "firmware-like/commands/stop_signal.hpp"

#include <signal.h>

#include <atomic>

namespace stillmap {
namespace {

std::atomic<bool> g_stop{false}, g_rotate{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch nothing else");

void on_stop(int number) {
  if (!g_stop.exchange(true)) return;
  signal(number, SIG_DFL);
  raise(number);
}

void on_hangup(int) {
  g_rotate = true;
}

void handle(int number, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigaction(number, &action, nullptr);
}

}  // namespace

void catch_stop_signals() {
  handle(SIGINT, on_stop);
  handle(SIGTERM, on_stop);
  handle(SIGHUP, on_hangup);
  handle(SIGPIPE, SIG_IGN);
  handle(SIGXFSZ, SIG_IGN);
}

bool stop_requested() {
  return g_stop.load(std::memory_order_relaxed);
}

bool rotation_requested() {
  return g_rotate.exchange(false);
}

}  // namespace stillmap
