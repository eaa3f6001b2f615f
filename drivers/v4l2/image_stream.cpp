#include "drivers/v4l2/image_stream.hpp"

#include <exception>

#include "runtime/core/clock.hpp"

namespace stillmap {

Result<std::unique_ptr<ImageStream>> ImageStream::open(SystemCalls& calls, const NodeRequest& request) {
  auto node = CaptureNode::open(calls, request);
  if (!node) return Error{node.error(), node.error_kind()};
  std::unique_ptr<ImageStream> stream(new ImageStream(std::move(*node)));
  const NodeFormat& format = stream->format();
  if (bytes_per_pixel(format.format) == 0) try {
      stream->decoder_ = std::make_unique<MjpegDecoder>(format.rows, format.cols);
      if (stream->decoder_->descriptor() < 0)
        return Error{request.path + ": no more open files are allowed (ulimit -n)", ErrorKind::cannot_open};
    } catch (const std::exception& e) {
      return Error{request.path + ": no memory or no thread to decode its images: " + e.what(),
                   ErrorKind::cannot_open};
    }
  return stream;
}

uint32_t ImageStream::descriptors(pollfd (&fds)[kDescriptors]) const {
  fds[0] = {node_->descriptor(), POLLIN, 0};
  if (!decoder_) return 1;
  fds[1] = {decoder_->descriptor(), POLLIN, 0};
  return 2;
}

Status ImageStream::take(Image& image, bool in_trouble) {
  if (decoder_)
    if (const Status status = take_decoded(image); status != Status::timeout) return status;
  FilledBuffer buffer;
  // More than the node has buffers cannot be there.
  for (uint32_t i = 0; i < CaptureNode::kBuffers; ++i) {
    if (const Status status = take_raw(buffer, in_trouble); status != Status::ok) return status;
    const int64_t stamp_ns = stamp_of(buffer);
    if (!decoder_) {
      image = {static_cast<int32_t>(buffer.index), stamp_ns};
      return Status::ok;
    }
    if (decoder_->submit({node_->image(buffer.index).data, buffer.bytes, buffer.index, stamp_ns})) continue;
    if (node_->give_back(buffer.index) != Status::ok) return Status::unavailable;
  }
  return Status::timeout;
}

/// A whole image in a buffer of the kernel's; others are given back.
Status ImageStream::take_raw(FilledBuffer& buffer, bool in_trouble) {
  const Status status = node_->take(buffer);
  if (status == Status::ok) {
    count_lost(buffer.sequence);
    errors_ = 0;
    if (!buffer.damaged) return Status::ok;
    return node_->give_back(buffer.index) == Status::ok ? Status::bad_data : Status::unavailable;
  }
  if (status == Status::bad_data && ++errors_ >= kMostErrors) return Status::unavailable;
  return in_trouble ? Status::unavailable : status;
}

Status ImageStream::take_decoded(Image& image) {
  MjpegDecoder::Decoded decoded;
  if (!decoder_->take(decoded)) return Status::timeout;
  image = {static_cast<int32_t>(decoded.slot), decoded.job.stamp_ns};
  const bool given_back = node_->give_back(decoded.job.buffer) == Status::ok;
  if (decoded.good && given_back) return Status::ok;
  decoder_->release(decoded.slot);
  return given_back ? Status::bad_data : Status::unavailable;
}

void ImageStream::discard() {
  FilledBuffer buffer;
  for (uint32_t i = 0; i < CaptureNode::kBuffers && node_->take(buffer) == Status::ok; ++i)
    node_->give_back(buffer.index);
}

void ImageStream::release(int32_t handle) {
  if (decoder_)
    decoder_->release(static_cast<uint32_t>(handle));
  else
    node_->give_back(static_cast<uint32_t>(handle));  // a failure is seen when the next image is taken
}

void ImageStream::copy(int32_t handle, ImageView<Rgb8> to) const {
  if (decoder_) {
    const ImageView<const Rgb8> image = decoder_->image(static_cast<uint32_t>(handle));
    copy_rgb({reinterpret_cast<const uint8_t*>(image.data), static_cast<uint32_t>(image.cols * 3)}, to);
  } else if (format().format == kYuyv) {
    yuyv_to_rgb(raw(handle), to);
  } else if (format().format == kGrey) {
    grey_to_rgb(raw(handle), to);
  } else {
    copy_rgb(raw(handle), to);
  }
}

/// Drivers that do not count stay at 0; one that counts anew goes back.
void ImageStream::count_lost(uint32_t sequence) {
  constexpr uint32_t kNewCount = 1000;
  const uint32_t gap = sequence - last_sequence_ - 1;
  if (any_ && gap < kNewCount) lost_ += gap;
  any_ = true;
  last_sequence_ = sequence;
}

int64_t ImageStream::stamp_of(const FilledBuffer& buffer) {
  if (buffer.monotonic) return buffer.stamp_ns;
  return clock_.map(buffer.stamp_ns, monotonic_ns()).monotonic_ns;
}

}  // namespace stillmap
