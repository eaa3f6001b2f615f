#pragma once

// `v4l2:xtion[:SERIAL],COLOUR_DEV`: depth of another camera with the colour of a video node.

#include <cstdint>
#include <memory>
#include <string>

#include "config/result.hpp"
#include "drivers/camera/camera_options.hpp"
#include "drivers/camera/frame_pairing.hpp"
#include "drivers/v4l2/image_stream.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Frames of a camera whose colour is replaced by that of a video node, nearest in time. The two are taken as
/// registered to each other: nothing is warped. `next` waits for the colour as long as
/// CameraOptions::max_pair_ms beyond its timeout; a frame for which none comes is bad_data. It neither
/// allocates nor formats text, as far as the depth camera's does not.
class WithColour final : public FrameSource {
 public:
  /// @param depth a camera (live), whose frames say when they were captured
  /// @param calls outlives the source
  /// @return as CaptureNode::open; the node has to give colour images of the size of the depth images
  /// @thread boot
  static Result<std::unique_ptr<WithColour>> open(std::unique_ptr<FrameSource> depth,
                                                  const std::string& colour_node,
                                                  const CameraOptions& options,
                                                  SystemCalls& calls = kernel_calls());
  ~WithColour() override;

  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  OdometryPort* odometry() override { return depth_->odometry(); }
  bool live() const override { return true; }
  Status reopen() override;
  void skip(uint32_t count) override { depth_->skip(count); }
  uint32_t left_out() const override { return depth_->left_out(); }
  const std::string& error() const override { return error_ ? *error_ : depth_->error(); }

 private:
  using Pairing = FramePairing<int32_t>;
  static constexpr int32_t kNoImage = -1;  ///< stands for the depth image, which is in the frame

  WithColour(std::unique_ptr<FrameSource> depth, std::string node, const CameraOptions& options,
             SystemCalls& calls);
  Result<Done> open_colour();
  void close_colour();
  Status find_colour(int64_t captured_ns, Pairing::Pair& pair);
  Status take_colour(Pairing::Pair& pair);
  void release(Pairing::Kind kind, int32_t handle);

  const std::unique_ptr<FrameSource> depth_;
  const std::string node_;
  const CameraOptions options_;
  SystemCalls& calls_;
  SourceInfo info_;
  std::unique_ptr<ImageStream> colour_;  ///< null: closed
  Pairing pairing_;
  bool in_trouble_ = false, fresh_ = true;
  bool depth_gone_ = false;

  // What `error` says, written beforehand.
  std::string no_colour_, gone_, closed_;
  const std::string* error_ = nullptr;  ///< null: what the depth camera says
};

}  // namespace stillmap
