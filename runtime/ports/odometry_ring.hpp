#pragma once

#include <array>
#include <cstddef>

#include "runtime/ports/odometry.hpp"

namespace stillmap {

/// The newest samples of an odometry; what a driver keeps behind its OdometryPort.
/// @thread one at a time
class OdometryRing {
 public:
  static constexpr size_t kSamples = 256;

  /// A sample that is not later than the newest one is refused; the oldest one makes way.
  /// @return whether it was taken
  bool push(const OdometrySample& sample) {
    if (count_ > 0 && sample.stamp <= past(0).stamp) return false;
    ring_[pushed_++ % kSamples] = sample;
    if (count_ < kSamples) ++count_;
    return true;
  }

  void clear() { count_ = 0; }
  size_t count() const { return count_; }

  /// As OdometryPort::at.
  Status at(Stamp stamp, OdometrySample& sample) const {
    for (size_t age = 0; age < count_; ++age) {
      if (past(age).stamp > stamp) continue;
      sample = age == 0 ? past(0) : between(past(age), past(age - 1), stamp);
      return Status::ok;
    }
    return Status::timeout;
  }

 private:
  /// @param age 0: the newest
  const OdometrySample& past(size_t age) const { return ring_[(pushed_ - 1 - age) % kSamples]; }

  static OdometrySample between(const OdometrySample& a, const OdometrySample& b, Stamp stamp) {
    const double share =
        static_cast<double>(stamp.ns - a.stamp.ns) / static_cast<double>(b.stamp.ns - a.stamp.ns);
    const Twistd step = log(inverse(a.T_odom_body) * b.T_odom_body);
    return {stamp, a.T_odom_body * exp(Twistd{share * step.v, share * step.w})};
  }

  std::array<OdometrySample, kSamples> ring_;
  size_t pushed_ = 0, count_ = 0;
};

}  // namespace stillmap
