#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "drivers/lcm/lcm.hpp"
#include "runtime/record/log_recorder.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap::test {

/// The images of frame `n`, 32x24, all different.
inline FrameMemory logged_frame(uint32_t n) {
  FrameMemory memory(32, 24);
  const auto depth = depth_pattern(24, 32, n);
  const auto colour = colour_pattern(24, 32, n);
  for (int32_t r = 0; r < 24; ++r)
    for (int32_t c = 0; c < 32; ++c) {
      memory.frame.depth_raw.at(r, c) = depth.view().at(r, c);
      memory.frame.colour.at(r, c) = colour.view().at(r, c);
    }
  memory.frame.depth_stamp.ns = 33'000'000 * (n + 1ll) + 7;
  memory.frame.colour_stamp.ns = memory.frame.depth_stamp.ns + 1001;
  memory.frame.sequence = n;
  return memory;
}

inline DecisionMessage decision_about(uint32_t n, bool used = true) {
  DecisionMessage decision;
  decision.utime.us = 1764000000000000 + 33333ll * n;
  decision.sequence = n;
  decision.used = used;
  return decision;
}

/// Writes the log of a run that did nothing but record.
class LoggedRun {
 public:
  explicit LoggedRun(std::string dir, RecordConfig record = with_frames(), LogDisk& disk = system_disk()) {
    SessionMessage session;
    session.utime.us = 1764000000000000;
    session.version = "1", session.source = "test", session.config_toml = "[record]\n";
    session.width = 32, session.height = 24;
    session.k[0] = session.k[1] = 30.25, session.k[2] = 15.5, session.k[3] = 11.5;
    session.distortion[2] = 0.001;
    session.depth_units_per_m = 5000;
    auto made = LogRecorder::create(record, dir, session, *codec_, disk);
    EXPECT_TRUE(made) << made.error();
    if (made) recorder_ = std::move(*made);
  }
  static RecordConfig with_frames() {
    RecordConfig record;
    record.log = record.frames = true;
    return record;
  }

  LogRecorder& recorder() { return *recorder_; }
  Status add(uint32_t n) { return add(decision_about(n)); }
  Status add(const DecisionMessage& decision) {
    const FrameMemory memory = logged_frame(decision.sequence);
    return recorder_->write(decision, decision.used ? &memory.frame : nullptr);
  }

 private:
  std::unique_ptr<MessageCodec> codec_ = make_lcm_codec();
  std::unique_ptr<LogRecorder> recorder_;
};

}  // namespace stillmap::test
