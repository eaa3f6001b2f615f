#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/camera/depth_registration.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// A source as its calibration says. Depth that is not registered to colour is registered when a frame is
/// finished, before anybody else sees it: what is recorded is registered.
class CalibratedSource final : public FrameSource {
 public:
  /// @param depth_bias, depth_camera in place of what the source says
  /// @return kind bad_usage: the calibration is for images of another size
  static Result<std::unique_ptr<FrameSource>> make(std::unique_ptr<FrameSource> source,
                                                   const DepthBias& depth_bias,
                                                   std::optional<DepthCamera> depth_camera);

  /// Of registering depth images of that size to colour: SourceInfo::registration_bytes.
  static uint64_t registration_bytes(int32_t rows, int32_t cols) {
    return DepthRegistration::bytes(rows, cols) +
           static_cast<uint64_t>(rows) * static_cast<uint64_t>(cols) * sizeof(uint16_t);
  }

  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  Status next_unfinished(RgbdFrame& frame, int32_t timeout_ms) override {
    return source_->next_unfinished(frame, timeout_ms);
  }
  void finish(RgbdFrame& frame) override;
  std::vector<Vec3> truth_cloud() const override { return source_->truth_cloud(); }
  OdometryPort* odometry() override { return source_->odometry(); }
  bool live() const override { return source_->live(); }
  Status reopen() override { return source_->reopen(); }
  void skip(uint32_t count) override { source_->skip(count); }
  uint32_t left_out() const override { return source_->left_out(); }
  const std::string& error() const override { return source_->error(); }

 private:
  explicit CalibratedSource(std::unique_ptr<FrameSource> source)
      : source_(std::move(source)), info_(source_->info()) {}

  std::unique_ptr<FrameSource> source_;
  SourceInfo info_;  ///< depth_camera: none any more
  std::optional<DepthRegistration> registration_;
  std::vector<uint16_t> depth_;  ///< of the frame that is being finished, not registered
};

}  // namespace stillmap
