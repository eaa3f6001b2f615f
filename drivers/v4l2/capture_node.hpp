#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/camera/frame_pairing.hpp"
#include "drivers/v4l2/convert.hpp"
#include "drivers/v4l2/pixel_format.hpp"
#include "drivers/v4l2/system_calls.hpp"
#include "kernels/base/status.hpp"

namespace stillmap {

/// What is asked of a video node.
struct NodeRequest {
  std::string path;
  ImageKind kind = ImageKind::depth;
  int32_t cols = 640, rows = 480;
  bool exact_size = false;  ///< else the size that comes nearest, as the node chooses
  double rate_hz = 30;
  bool auto_exposure = true, auto_white_balance = true;  ///< of colour; where the camera has such a setting
};

/// What was agreed on.
struct NodeFormat {
  uint32_t format = 0;  ///< fourcc
  int32_t cols = 0, rows = 0;
  uint32_t pitch_bytes = 0;   ///< of a row; 0: compressed
  uint32_t needed_bytes = 0;  ///< of a whole image; compressed: of a buffer
  double rate_hz = 0;         ///< 0: the node does not say
};

/// A filled buffer, the caller's until it is given back.
struct FilledBuffer {
  uint32_t index = 0;
  uint32_t bytes = 0;
  uint32_t sequence = 0;   ///< as the driver counts its images, those that it lost included
  int64_t stamp_ns = 0;    ///< first byte or end of exposure, as the driver does it
  bool monotonic = false;  ///< stamp_ns is CLOCK_MONOTONIC, else a clock of the camera's
  bool damaged = false;    ///< marked so by the driver, or too short
};

/// A video node (/dev/videoN) that sends images of one kind through memory-mapped buffers. Formats and rate
/// are negotiated when it is opened: of those that can be used the first, in the order of formats_of, that
/// reaches nine tenths of the rate; else the fastest. Buffers are taken then as well; afterwards nothing
/// allocates.
/// @thread open, destructor: boot or the reader thread; the others: the reader thread
class CaptureNode {
 public:
  static constexpr uint32_t kBuffers = 8;
  /// As many images wait for their partners, one is worked on, one is being filled.
  static constexpr uint32_t kLeastBuffers = FramePairing<int>::kPending + 2;

  /// The node sends from here on.
  /// @return kind cannot_open: it is not there, in use, or offers nothing that can be used; the message then
  /// has a table
  ///         of what it offers and says what would do
  static Result<std::unique_ptr<CaptureNode>> open(SystemCalls& calls, const NodeRequest& request);
  ~CaptureNode();
  CaptureNode(const CaptureNode&) = delete;
  CaptureNode& operator=(const CaptureNode&) = delete;

  const NodeFormat& format() const { return format_; }
  /// To wait on with poll.
  int descriptor() const { return fd_; }

  /// Takes the oldest filled buffer, without waiting.
  /// @return ok; timeout: none is there; bad_data: the driver could not fill one, the next may come;
  ///         unavailable: the node is gone or no longer works
  Status take(FilledBuffer& buffer);
  /// Gives a buffer back to be filled.
  /// @return ok or unavailable
  Status give_back(uint32_t index);
  RawImage image(uint32_t index) const { return {buffers_[index].data, format_.pitch_bytes}; }

 private:
  struct Mapped {
    uint8_t* data = nullptr;
    size_t bytes = 0;
  };

  CaptureNode(SystemCalls& calls, std::string path, int fd)
      : calls_(calls), path_(std::move(path)), fd_(fd) {}
  Result<Done> negotiate(const NodeRequest& request);
  Result<NodeFormat> agree_on(uint32_t format, const NodeRequest& request);
  double set_rate(double rate_hz);
  void set_automatics(const NodeRequest& request);
  Result<Done> take_buffers();
  Result<Done> start();

  SystemCalls& calls_;
  const std::string path_;
  const int fd_;
  NodeFormat format_;
  std::vector<Mapped> buffers_;
  bool sending_ = false;
  bool broken_ = false;
};

}  // namespace stillmap
