#pragma once

#include <chrono>
#include <cstdio>
#include <string>

namespace stillmap::parity {

/// Adds up the time between `start` and `stop`.
class Timer {
 public:
  void start() { start_ = Clock::now(); }
  void stop() { ms_ += std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }
  double ms() const { return ms_; }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_;
  double ms_ = 0;
};

/// One line a check: "ok NAME value limit ms" or "FAIL ...".
class Report {
 public:
  /// Passes when `value` is at most `limit`; what is not a number fails.
  /// @param ms spent in the engine that is looked at
  void check(const std::string& name, double value, double limit, double ms) {
    const bool ok = value <= limit;
    std::printf("%s %s %.3g %.3g %.1f\n", ok ? "ok" : "FAIL", name.c_str(), value, limit, ms);
    std::fflush(stdout);
    ++checks_;
    if (!ok) ++failures_;
  }
  void failed(const std::string& name, const std::string& why) {
    std::printf("FAIL %s: %s\n", name.c_str(), why.c_str());
    ++checks_;
    ++failures_;
  }
  int checks() const { return checks_; }
  int failures() const { return failures_; }

 private:
  int checks_ = 0, failures_ = 0;
};

}  // namespace stillmap::parity
