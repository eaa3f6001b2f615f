#pragma once

#include <string>
#include <vector>

#include "kernels/engine.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/ports/frame_observer.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Keeps some frames of a recording with their mask and with the map seen from their pose, for `stillmap
/// picture`.
/// @thread as FrameObserver
class Snapshots final : public FrameObserver {
 public:
  /// @param folder is there  @param frames expected  @param count to be kept: evenly spread, the last frame
  /// among them
  Snapshots(std::string folder, Engine& engine, const SourceInfo& source, int64_t frames, int32_t count);

  void begin(const FrameSource&, const SourceInfo&) override {}
  void see(const RgbdFrame& frame, const FrameResult& result, const Engine& engine) override;

  /// What could not be written; empty: nothing.
  const std::string& error() const { return error_; }

 private:
  bool due() const;
  void take(const FrameResult& result);

  const std::string folder_;
  Engine& engine_;
  const Intrinsics k_;
  const int64_t frames_;
  const int32_t count_;
  std::vector<float> depth_m_;
  std::vector<Rgb8> colour_;
  int64_t seen_ = 0;
  int32_t taken_ = 0;
  std::string error_;
};

}  // namespace stillmap
