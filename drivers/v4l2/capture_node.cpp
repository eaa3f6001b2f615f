#include "drivers/v4l2/capture_node.hpp"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <optional>

#include "drivers/v4l2/node_description.hpp"

namespace stillmap {
namespace {

constexpr int32_t kLeastSide = 16, kMostSide = 4096;
constexpr uint32_t kMostImageBytes = 64u << 20;
constexpr double kRateEnough = 0.9;

Error no_node(std::string message) {
  return {std::move(message), ErrorKind::cannot_open};
}

const char* name_of(ImageKind kind) {
  return kind == ImageKind::depth ? "depth" : "colour";
}

std::string usable_text(ImageKind kind) {
  std::string text;
  for (const uint32_t format : formats_of(kind))
    text += fmt::format("{}{}", text.empty() ? "" : ", ", fourcc_text(format));
  return text;
}

/// A size of the node's that another request could name; empty where there is none.
std::string other_size_text(const NodeDescription& node, const NodeRequest& wanted) {
  for (const uint32_t format : formats_of(wanted.kind))
    if (const FormatOffer* const offer = node.find(format))
      for (const SizeOffer& size : offer->sizes)
        if (!size.holds(wanted.cols, wanted.rows))
          return fmt::format("; --set source.cols={} --set source.rows={} asks for another size",
                             size.max_cols, size.max_rows);
  return {};
}

Error refusal(const NodeDescription& node, const NodeRequest& wanted, const std::string& reasons) {
  std::string text = fmt::format(
      "{} ({}) gives no {} images that can be used: {} of {}x{} {}needed{}", node.path, node.name,
      name_of(wanted.kind), usable_text(wanted.kind), wanted.cols, wanted.rows,
      wanted.exact_size ? "(as the depth images are) " : "or near it ", other_size_text(node, wanted));
  if (!reasons.empty()) text += "; tried:" + reasons;
  return no_node(text + "\nit offers:" + offers_text(node));
}

/// Why what the node answered cannot be used; empty: it can.
std::string problem_of(const v4l2_pix_format& answer, uint32_t asked, const NodeRequest& wanted) {
  const auto cols = static_cast<int32_t>(answer.width), rows = static_cast<int32_t>(answer.height);
  if (answer.pixelformat != asked) return fmt::format("it answers {}", fourcc_text(answer.pixelformat));
  if (cols < kLeastSide || rows < kLeastSide || cols > kMostSide || rows > kMostSide || cols % 2 != 0)
    return fmt::format("it answers {}x{}", answer.width, answer.height);
  if (wanted.exact_size && (cols != wanted.cols || rows != wanted.rows))
    return fmt::format("it answers {}x{}", cols, rows);
  if (answer.field != V4L2_FIELD_NONE && answer.field != V4L2_FIELD_ANY)
    return "it sends half images (interlaced)";
  const uint32_t pixel = bytes_per_pixel(asked);
  const uint32_t row_bytes = pixel * answer.width;
  if (answer.bytesperline > 0 && pixel > 0 && answer.bytesperline < row_bytes)
    return fmt::format("its rows of {} bytes are too short", answer.bytesperline);
  const uint64_t pitch = std::max(answer.bytesperline, row_bytes);
  if (pixel > 0 && pitch * (answer.height - 1) + row_bytes > answer.sizeimage)
    return fmt::format("its images of {} bytes are too small", answer.sizeimage);
  if (answer.sizeimage == 0 || answer.sizeimage > kMostImageBytes)
    return fmt::format("its images have {} bytes", answer.sizeimage);
  return {};
}

}  // namespace

Result<std::unique_ptr<CaptureNode>> CaptureNode::open(SystemCalls& calls, const NodeRequest& request) {
  const int fd = calls.open(request.path.c_str());
  if (fd < 0) return open_problem(request.path, errno);
  std::unique_ptr<CaptureNode> node(new CaptureNode(calls, request.path, fd));
  if (const auto agreed = node->negotiate(request); !agreed)
    return Error{agreed.error(), agreed.error_kind()};
  if (request.kind == ImageKind::colour) node->set_automatics(request);
  if (const auto taken = node->take_buffers(); !taken) return Error{taken.error(), taken.error_kind()};
  if (const auto started = node->start(); !started) return Error{started.error(), started.error_kind()};
  return node;
}

CaptureNode::~CaptureNode() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (sending_) calls_.control(fd_, VIDIOC_STREAMOFF, &type);
  for (const Mapped& buffer : buffers_) calls_.unmap(buffer.data, buffer.bytes);
  calls_.close(fd_);
}

Result<Done> CaptureNode::negotiate(const NodeRequest& request) {
  const auto node = describe_open_node(calls_, fd_, path_);
  if (!node) return Error{node.error(), node.error_kind()};
  if (!node->streams)
    return no_node(
        path_ + " (" + node->name +
        ") sends no images by memory-mapped buffers of one plane; v4l2-ctl --list-devices shows the "
        "camera's other nodes");
  std::string reasons;
  std::optional<NodeFormat> best;
  for (const uint32_t format : formats_of(request.kind)) {
    if (!node->find(format)) continue;
    const auto agreed = agree_on(format, request);
    if (!agreed) {
      reasons += fmt::format(" {}: {};", fourcc_text(format), agreed.error());
      continue;
    }
    if (!best || agreed->rate_hz > best->rate_hz) best = *agreed;
    if (agreed->rate_hz == 0 || agreed->rate_hz >= kRateEnough * request.rate_hz) break;
  }
  if (!best) return refusal(*node, request, reasons);
  // The last one that was tried need not be the best.
  const auto agreed = agree_on(best->format, request);
  if (!agreed)
    return refusal(*node, request, fmt::format(" {}: {}", fourcc_text(best->format), agreed.error()));
  format_ = *agreed;
  return Done{};
}

/// @return why not, for the table
Result<NodeFormat> CaptureNode::agree_on(uint32_t format, const NodeRequest& request) {
  v4l2_format wanted{};
  wanted.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  wanted.fmt.pix.width = static_cast<uint32_t>(request.cols);
  wanted.fmt.pix.height = static_cast<uint32_t>(request.rows);
  wanted.fmt.pix.pixelformat = format;
  wanted.fmt.pix.field = V4L2_FIELD_NONE;
  if (calls_.control(fd_, VIDIOC_S_FMT, &wanted) < 0)
    return Error{errno == EBUSY ? "another program uses the camera" : std::strerror(errno)};
  const v4l2_pix_format& answer = wanted.fmt.pix;
  if (std::string problem = problem_of(answer, format, request); !problem.empty())
    return Error{std::move(problem)};
  NodeFormat agreed;
  agreed.format = format;
  agreed.cols = static_cast<int32_t>(answer.width);
  agreed.rows = static_cast<int32_t>(answer.height);
  const uint32_t row_bytes = bytes_per_pixel(format) * answer.width;
  if (row_bytes > 0) agreed.pitch_bytes = std::max(answer.bytesperline, row_bytes);
  agreed.needed_bytes =
      row_bytes > 0 ? agreed.pitch_bytes * (answer.height - 1) + row_bytes : answer.sizeimage;
  agreed.rate_hz = set_rate(request.rate_hz);
  return agreed;
}

/// @return what the node will do, 0 where it does not say
double CaptureNode::set_rate(double rate_hz) {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (calls_.control(fd_, VIDIOC_G_PARM, &parameters) < 0 ||
      !(parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME))
    return 0;
  constexpr double kParts = 1000;
  parameters.parm.capture.timeperframe = {static_cast<uint32_t>(kParts),
                                          static_cast<uint32_t>(std::lround(kParts * rate_hz))};
  if (calls_.control(fd_, VIDIOC_S_PARM, &parameters) < 0) return 0;
  const v4l2_fract& interval = parameters.parm.capture.timeperframe;
  return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

/// A camera without such a setting, or with another choice of values, stays as it is.
void CaptureNode::set_automatics(const NodeRequest& request) {
  const auto set = [&](uint32_t id, int32_t value) {
    v4l2_control control{id, value};
    return calls_.control(fd_, VIDIOC_S_CTRL, &control) >= 0;
  };
  set(V4L2_CID_AUTO_WHITE_BALANCE, request.auto_white_balance ? 1 : 0);
  if (!request.auto_exposure)
    set(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
  else if (!set(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY))
    set(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_AUTO);
}

Result<Done> CaptureNode::take_buffers() {
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (calls_.control(fd_, VIDIOC_REQBUFS, &request) < 0)
    return no_node(fmt::format("{}: no buffers: {}; {}", path_, std::strerror(errno),
                               errno == EBUSY ? "another program uses the camera, `fuser -v` names it"
                                              : "the end of `dmesg` may say why"));
  if (request.count < kLeastBuffers)
    return no_node(
        fmt::format("{}: its driver gives {} buffers, {} are needed", path_, request.count, kLeastBuffers));
  buffers_.reserve(request.count);
  for (uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer{};
    buffer.index = i;
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (calls_.control(fd_, VIDIOC_QUERYBUF, &buffer) < 0 || buffer.length < format_.needed_bytes)
      return no_node(
          fmt::format("{}: buffer {} has {} bytes, an image needs {}; the driver does not do what it says",
                      path_, i, buffer.length, format_.needed_bytes));
    void* const memory = calls_.map(fd_, buffer.length, buffer.m.offset);
    if (!memory) return no_node(fmt::format("{}: no memory for its images: {}", path_, std::strerror(errno)));
    buffers_.push_back({static_cast<uint8_t*>(memory), buffer.length});
  }
  return Done{};
}

Result<Done> CaptureNode::start() {
  for (uint32_t i = 0; i < buffers_.size(); ++i)
    if (give_back(i) != Status::ok)
      return no_node(fmt::format("{}: it does not take a buffer: {}; unplug and plug the camera", path_,
                                 std::strerror(errno)));
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (calls_.control(fd_, VIDIOC_STREAMON, &type) < 0)
    return no_node(fmt::format(
        "{}: it does not begin to send: {}; {}", path_, std::strerror(errno),
        errno == ENOSPC ? "too little is left of the USB's bandwidth: another port, or a lower source.rate_hz"
                        : "unplug and plug the camera, close other programs that use it"));
  sending_ = true;
  return Done{};
}

Status CaptureNode::take(FilledBuffer& filled) {
  if (broken_) return Status::unavailable;
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  if (calls_.control(fd_, VIDIOC_DQBUF, &buffer) < 0) {
    if (errno == EAGAIN) return Status::timeout;
    if (errno == EIO) return Status::bad_data;
    broken_ = true;
    return Status::unavailable;
  }
  if (buffer.index >= buffers_.size()) {
    broken_ = true;
    return Status::unavailable;
  }
  filled.index = buffer.index;
  filled.bytes = std::min<uint32_t>(buffer.bytesused, static_cast<uint32_t>(buffers_[buffer.index].bytes));
  filled.sequence = buffer.sequence;
  filled.stamp_ns = static_cast<int64_t>(buffer.timestamp.tv_sec) * 1'000'000'000 +
                    static_cast<int64_t>(buffer.timestamp.tv_usec) * 1000;
  filled.monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  const bool whole = format_.pitch_bytes > 0 ? filled.bytes >= format_.needed_bytes : filled.bytes > 0;
  filled.damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || !whole;
  return Status::ok;
}

Status CaptureNode::give_back(uint32_t index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  if (calls_.control(fd_, VIDIOC_QBUF, &buffer) >= 0) return Status::ok;
  broken_ = true;
  return Status::unavailable;
}

}  // namespace stillmap
