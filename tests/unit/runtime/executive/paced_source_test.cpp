#include "runtime/executive/paced_source.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "runtime/core/clock.hpp"
#include "tests/support/frame_memory.hpp"

namespace stillmap {
namespace {

constexpr int64_t kPacedPeriod_ns = 20'000'000;

/// Frames at a steady rate; each takes a while to decode.
class SteadySource final : public FrameSource {
 public:
  SteadySource(int64_t frames, std::chrono::milliseconds decode) : decode_(decode) { info_.frames = frames; }

  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t) override {
    if (next_ >= info_.frames) return Status::end;
    std::this_thread::sleep_for(decode_);
    frame.sequence = static_cast<uint32_t>(next_);
    frame.depth_stamp.ns = 5'000'000'000 + next_++ * kPacedPeriod_ns;
    return Status::ok;
  }
  void skip(uint32_t count) override { next_ += count; }
  const std::string& error() const override { return error_; }

 private:
  SourceInfo info_;
  const std::chrono::milliseconds decode_;
  int64_t next_ = 0;
  std::string error_;
};

TEST(PacedSource, AFrameComesWhenItsTimeHasCome) {
  SteadySource source(10, std::chrono::milliseconds(0));
  PacedSource paced(source);
  test::FrameMemory memory(4, 4);
  int64_t first_ns = 0;
  for (int i = 0; i < 10; ++i) {
    Status status = Status::timeout;
    while (status == Status::timeout) status = paced.next(memory.frame, 5);
    ASSERT_EQ(status, Status::ok);
    const int64_t now_ns = monotonic_ns();
    if (i == 0) first_ns = now_ns;
    EXPECT_GE(now_ns - first_ns, (memory.frame.sequence) * kPacedPeriod_ns - 1'000'000);  // never early
    EXPECT_LE(memory.frame.captured.ns, now_ns);
  }
  EXPECT_EQ(paced.next(memory.frame, 5), Status::end);
}

TEST(PacedSource, WhatTakesTooLongToDecodeIsSkippedAsACameraWould) {
  SteadySource source(30, std::chrono::milliseconds(50));  // two and a half periods
  PacedSource paced(source);
  test::FrameMemory memory(4, 4);
  const int64_t start_ns = monotonic_ns();
  uint32_t frames = 0;
  for (Status status = Status::ok; status != Status::end;) {
    status = paced.next(memory.frame, 100);
    frames += status == Status::ok;
  }
  EXPECT_EQ(frames + paced.left_out(), 30u);
  EXPECT_GT(paced.left_out(), 5u);
  // The recording lasts 0.6 s; played without skipping it would take 1.5 s.
  EXPECT_LT(static_cast<double>(monotonic_ns() - start_ns) * 1e-9, 1.3);
}

}  // namespace
}  // namespace stillmap
