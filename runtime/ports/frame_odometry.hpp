#pragma once

#include <cstdint>
#include <mutex>

#include "runtime/ports/messages.hpp"
#include "runtime/ports/odometry.hpp"

namespace stillmap {

/// Stands between the pipeline and an odometry: within one frame the same question has the same answer,
/// whatever comes in meanwhile, and what was answered can be logged. @thread real-time thread; neither
/// allocates nor waits
class FrameOdometry final : public OdometryPort {
 public:
  /// @param odometry outlives this; null: nothing is known, ever
  explicit FrameOdometry(OdometryPort* odometry) : odometry_(odometry) {}

  /// Before each frame.
  void begin_frame() { asked_ = 0; }

  Status at(Stamp stamp, OdometrySample& sample) override {
    for (uint32_t i = 0; i < asked_; ++i)
      if (asks_[i].answer.asked == stamp) return give(asks_[i], sample);
    if (!odometry_ || asked_ == kOdometryAnswers) return Status::timeout;
    Ask& ask = asks_[asked_++];
    ask.answer.asked = stamp;
    ask.status = odometry_->at(stamp, ask.answer.sample);
    return give(ask, sample);
  }

  uint32_t refused() const override { return odometry_ ? odometry_->refused() : 0; }

  /// What was answered in this frame.
  void log(DecisionMessage& decision) const {
    decision.odometry_answers = 0;
    for (uint32_t i = 0; i < asked_; ++i)
      if (asks_[i].status == Status::ok) decision.odometry[decision.odometry_answers++] = asks_[i].answer;
  }

 private:
  struct Ask {
    OdometryAnswer answer;
    Status status = Status::timeout;
  };

  static Status give(const Ask& ask, OdometrySample& sample) {
    if (ask.status == Status::ok) sample = ask.answer.sample;
    return ask.status;
  }

  OdometryPort* const odometry_;
  Ask asks_[kOdometryAnswers];
  uint32_t asked_ = 0;
};

/// The odometry of a log: what was answered in the live run is answered again, nothing else.
/// @thread begin_frame: reader; at: another. A log is a recording: a moment's wait for the reader does no
/// harm
class LoggedOdometry final : public OdometryPort {
 public:
  /// Before each frame.
  void begin_frame(const DecisionMessage& decision) {
    const std::lock_guard lock(mutex_);
    decision_ = decision;
  }

  Status at(Stamp stamp, OdometrySample& sample) override {
    const std::lock_guard lock(mutex_);
    for (uint32_t i = 0; i < decision_.odometry_answers; ++i) {
      if (decision_.odometry[i].asked != stamp) continue;
      sample = decision_.odometry[i].sample;
      return Status::ok;
    }
    return Status::timeout;
  }

 private:
  std::mutex mutex_;
  DecisionMessage decision_;
};

}  // namespace stillmap
