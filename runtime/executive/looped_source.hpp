#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "runtime/executive/frame_slots.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Some frames of a source, read once and then played forwards and backwards without end: the camera goes to
/// and fro. For runs of any length whose frames cost nothing.
/// @thread as FrameSource
class LoopedSource final : public FrameSource {
 public:
  /// Reads up to `frames` usable frames.  @thread boot
  LoopedSource(FrameSource& source, uint32_t frames);

  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  void skip(uint32_t count) override { played_ += count; }
  const std::string& error() const override { return error_; }

 private:
  SourceInfo info_;
  std::vector<std::unique_ptr<FrameSlot>> frames_;
  int64_t period_ns_ = 0;
  uint32_t played_ = 0;
  std::string error_;
};

}  // namespace stillmap
