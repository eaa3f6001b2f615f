#pragma once

#include <poll.h>

#include <cstdint>
#include <memory>

#include "config/result.hpp"
#include "drivers/camera/device_clock.hpp"
#include "drivers/v4l2/capture_node.hpp"
#include "drivers/v4l2/mjpeg_decoder.hpp"
#include "kernels/base/status.hpp"

namespace stillmap {

/// Depth or colour images of one video node, as they come: stamped with CLOCK_MONOTONIC, decoded where they
/// are compressed. An image is the caller's until it is released; it is copied straight from the kernel's
/// buffer.
/// @thread open, destructor: boot or the reader thread; the others: the reader thread
class ImageStream {
 public:
  struct Image {
    int32_t handle = -1;  ///< of the kernel's buffer, or of the memory that it was decoded to
    int64_t stamp_ns = 0;
  };
  static constexpr uint32_t kDescriptors = 2;

  /// @return as CaptureNode::open
  static Result<std::unique_ptr<ImageStream>> open(SystemCalls& calls, const NodeRequest& request);

  const NodeFormat& format() const { return node_->format(); }
  /// What to wait on for images. @return how many were filled
  uint32_t descriptors(pollfd (&fds)[kDescriptors]) const;

  /// The next image that is there, without waiting.
  /// @param in_trouble poll reported an error of the node
  /// @return ok; timeout: none is there; bad_data: one came that cannot be used and was passed over;
  ///         unavailable: the node is gone or no longer works
  Status take(Image& image, bool in_trouble);
  void release(int32_t handle);
  /// Passes over what is there; before the first `take`.
  void discard();
  void copy(int32_t handle, ImageView<uint16_t> to) const { copy_depth(raw(handle), to); }
  void copy(int32_t handle, ImageView<Rgb8> to) const;

  /// Images that the driver of the kernel lost because nobody took them in time, as it says.
  uint32_t lost() const { return lost_; }

 private:
  static constexpr uint32_t kMostErrors = 10;  ///< one after the other, of which none is said to be the end

  explicit ImageStream(std::unique_ptr<CaptureNode> node) : node_(std::move(node)) {}
  Status take_raw(FilledBuffer& buffer, bool in_trouble);
  Status take_decoded(Image& image);
  void count_lost(uint32_t sequence);
  int64_t stamp_of(const FilledBuffer& buffer);
  RawImage raw(int32_t handle) const { return node_->image(static_cast<uint32_t>(handle)); }

  std::unique_ptr<CaptureNode> node_;
  std::unique_ptr<MjpegDecoder>
      decoder_;        ///< null: not compressed; goes before the node, whose memory it reads
  DeviceClock clock_;  ///< of nodes whose stamps are not CLOCK_MONOTONIC
  bool any_ = false;
  uint32_t last_sequence_ = 0, lost_ = 0;
  uint32_t errors_ = 0;  ///< since the last image
};

}  // namespace stillmap
