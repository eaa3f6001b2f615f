#pragma once

// `v4l2:DEPTH_DEV[,COLOUR_DEV]`: a depth camera that Linux has a driver for.

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "config/result.hpp"
#include "drivers/camera/camera_options.hpp"
#include "drivers/camera/frame_pairing.hpp"
#include "drivers/v4l2/image_stream.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Depth of one video node with the colour of another, which has to be registered to it and of the same size.
/// Without a colour node the colour of every frame is mid-grey. Depth images without a partner are counted as
/// left out. `next` neither allocates nor formats text; its `error()` was written when the source was made.
class V4l2Source final : public FrameSource {
 public:
  static constexpr float kDepthUnitsPerM = 1000;  ///< unless the options say otherwise

  struct Nodes {
    std::string depth, colour;  ///< colour: empty where there is none
  };

  /// @param calls outlives the source
  /// @return kind bad_usage: the intrinsics are missing or make no sense (a video node does not know them);
  ///         kind cannot_open: as CaptureNode::open
  /// @thread boot
  static Result<std::unique_ptr<V4l2Source>> open(const Nodes& nodes, const CameraOptions& options,
                                                  SystemCalls& calls);

  ~V4l2Source() override;

  const SourceInfo& info() const override { return info_; }
  /// bad_data: an image came damaged; unavailable: a node is gone, or nothing came for CameraOptions::gone_s.
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  bool live() const override { return true; }
  Status reopen() override;
  void skip(uint32_t count) override { to_skip_ += count; }
  uint32_t left_out() const override;
  const std::string& error() const override { return *error_; }

  /// Of the open nodes, for messages: "Y16 640x480 at 30 Hz, YUYV 640x480 at 30 Hz".  @thread the reader
  /// thread
  std::string formats_text() const;
  /// Colour images that found no partner.
  uint32_t unpaired_colour() const { return pairing_.unpaired(Pairing::kColour); }

 private:
  using Pairing = FramePairing<int32_t>;

  V4l2Source(Nodes nodes, const CameraOptions& options, SystemCalls& calls);
  Result<Done> open_nodes();
  void close_nodes();
  void begin();
  Status take_frame(RgbdFrame& frame);
  Status take_image(Pairing::Kind kind, RgbdFrame& frame, bool& any);
  void deliver(const Pairing::Pair& pair, RgbdFrame& frame);
  void release(Pairing::Kind kind, int32_t handle);
  void wait(int64_t until_ns);
  Status fail(Status status, const std::string& why);

  const Nodes nodes_;
  const CameraOptions options_;
  SystemCalls& calls_;
  SourceInfo info_;

  std::array<std::unique_ptr<ImageStream>, 2> streams_;  ///< by Pairing::Kind; both null: closed
  std::array<bool, 2> in_trouble_{};                     ///< poll reported an error
  Pairing pairing_;
  bool fresh_ = true;          ///< opened, and nobody has asked for a frame
  int64_t last_frame_ns_ = 0;  ///< CLOCK_MONOTONIC; or when the first was asked for
  uint32_t sequence_ = 0, to_skip_ = 0;
  uint32_t lost_before_ = 0;  ///< by streams that are closed

  // What `error` says, written beforehand.
  std::array<std::string, 2> damaged_, gone_;
  std::string silent_, closed_, other_size_;
  const std::string* error_;
};

/// Makes the source from what follows "v4l2:".
/// @return as V4l2Source::open; kind bad_usage also where `rest` is none of DEPTH_DEV and
/// DEPTH_DEV,COLOUR_DEV
/// @thread boot
Result<std::unique_ptr<FrameSource>> open_v4l2(const std::string& rest, const CameraOptions& options,
                                               SystemCalls& calls = kernel_calls());

}  // namespace stillmap
