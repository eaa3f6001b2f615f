#pragma once

// Whoever looks over a run's shoulder: measuring, debugging. The runtime does not know who it is.

namespace stillmap {

class Engine;
class FrameSource;
struct FrameResult;
struct RgbdFrame;
struct SourceInfo;

/// Sees every processed frame while the engine still holds it. @thread the one that runs the loop
class FrameObserver {
 public:
  virtual ~FrameObserver() = default;

  /// Once, before the first frame. @param info with the camera that the engine uses (no distortion left)
  virtual void begin(const FrameSource& source, const SourceInfo& info) = 0;
  /// After `Pipeline::process`, outside of the time that is measured.
  virtual void see(const RgbdFrame& frame, const FrameResult& result, const Engine& engine) = 0;
};

}  // namespace stillmap
