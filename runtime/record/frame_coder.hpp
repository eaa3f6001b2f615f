#pragma once

// Images of a frame to the bytes of a FrameMessage and back.
//
// Depth is packed as it is, zstd level 1: of a structured-light camera it has few different values that
// repeat, which any prediction hides (measured, 640x480: 95 to 105 kB and 3 ms; with left differences in
// split bytes 90 to 152 kB). Colour without loss: green, red - green and blue - green, each as difference
// from the pixel before, zstd level 1 (378 to 558 kB and 9 ms; as it is 768 to 792 kB); with loss JPEG (66 to
// 77 kB and 2 ms).

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "kernels/base/status.hpp"
#include "runtime/ports/messages.hpp"

struct ZSTD_CCtx_s;
struct ZSTD_DCtx_s;

namespace stillmap {

/// @thread one. After boot zstd_colour does not allocate; JPEG's library takes its work memory (under 1 MB
/// for 640x480) for each image and gives it back.
class FrameEncoder {
 public:
  /// @param rows, cols of the frames, 1..8192  @param colour zstd_colour or jpeg.  @thread boot
  FrameEncoder(int32_t rows, int32_t cols, ImageCoding colour);
  ~FrameEncoder();
  FrameEncoder(const FrameEncoder&) = delete;
  FrameEncoder& operator=(const FrameEncoder&) = delete;

  /// Memory that it takes at boot, about.
  static uint64_t planned_bytes(int32_t rows, int32_t cols);
  /// Of depth and colour of the longest message together.
  uint32_t most_bytes() const { return static_cast<uint32_t>(depth_packed_.size() + colour_packed_.size()); }

  /// Stamps, number, images and their checksum; `utime` is left alone. The message's views are good until the
  /// next call. @param frame of the size given at boot  @return ok; bad_data: not that size, or it cannot be
  /// packed
  Status encode(const RgbdFrame& frame, FrameMessage& message);

 private:
  uint32_t pack_depth(const ImageView<uint16_t>& depth);
  uint32_t pack_colour(const ImageView<Rgb8>& colour);
  uint32_t pack_jpeg(const ImageView<Rgb8>& colour);

  struct Packers;
  const int32_t rows_, cols_;
  const ImageCoding colour_;
  std::unique_ptr<Packers> packers_;
  std::vector<uint8_t> plain_, depth_packed_, colour_packed_;
};

/// What FrameMessage::crc32c has to be.
uint32_t checksum_of(const FrameMessage& message);

/// @thread one; not the real-time thread
class FrameDecoder {
 public:
  FrameDecoder();
  ~FrameDecoder();
  FrameDecoder(FrameDecoder&&) noexcept;
  FrameDecoder& operator=(FrameDecoder&&) noexcept;

  /// @param frame with memory of the frame's size. After bad_data its images hold anything.
  /// @return ok; bad_data: wrong checksum, no such coding, or not an image of that size: see error()
  Status decode(const FrameMessage& message, RgbdFrame& frame);
  const std::string& error() const { return error_; }

 private:
  Status refused(std::string why);
  bool unpack_colour(const FrameMessage& message, const ImageView<Rgb8>& colour);

  struct Unpackers;
  std::unique_ptr<Unpackers> unpackers_;
  std::vector<uint8_t> plain_;
  std::string error_;
};

}  // namespace stillmap
