#include "drivers/v4l2/v4l2_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/validate.hpp"
#include "runtime/core/clock.hpp"

namespace stillmap {
namespace {

int64_t nanoseconds(double milliseconds) {
  return std::llround(milliseconds * 1e6);
}

Error bad(std::string message) {
  return {std::move(message), ErrorKind::bad_usage};
}

std::string format_text(const NodeFormat& format) {
  std::string text = fmt::format("{} {}x{}", fourcc_text(format.format), format.cols, format.rows);
  if (format.rate_hz > 0) text += fmt::format(" at {:.3g} Hz", format.rate_hz);
  return text;
}

}  // namespace

V4l2Source::V4l2Source(Nodes nodes, const CameraOptions& options, SystemCalls& calls)
    : nodes_(std::move(nodes)),
      options_(options),
      calls_(calls),
      pairing_(nanoseconds(options.max_pair_ms)),
      error_(&closed_) {
  info_.name = "v4l2:" + nodes_.depth + (nodes_.colour.empty() ? "" : "," + nodes_.colour);
  info_.depth_units_per_m = options.depth_units_per_m > 0 ? options.depth_units_per_m : kDepthUnitsPerM;
  for (const Pairing::Kind kind : {Pairing::kDepth, Pairing::kColour}) {
    const std::string& node = kind == Pairing::kDepth ? nodes_.depth : nodes_.colour;
    damaged_[kind] =
        node +
        ": an image came damaged and was passed over; a worn cable, or too many cameras at one USB "
        "port, may be the reason";
    gone_[kind] = node + ": the camera is gone; plug it in again, `dmesg` says why";
  }
  silent_ = fmt::format("{}: no frame for {:.3g} s; {}`dmesg` may say why", info_.name, options.gone_s,
                        nodes_.colour.empty()
                            ? ""
                            : "one of the nodes sends nothing, or their stamps are farther apart than "
                              "source.max_pair_ms; ");
  closed_ = info_.name + ": the camera is closed";
}

V4l2Source::~V4l2Source() {
  close_nodes();
}

Result<std::unique_ptr<V4l2Source>> V4l2Source::open(const Nodes& nodes, const CameraOptions& options,
                                                     SystemCalls& calls) {
  if (!options.camera)
    return bad(
        "v4l2: a video node does not know its intrinsics; say them with --camera FX,FY,CX,CY or in a file "
        "that "
        "camera.calibration names");
  std::unique_ptr<V4l2Source> source(new V4l2Source(nodes, options, calls));
  if (const auto opened = source->open_nodes(); !opened) return Error{opened.error(), opened.error_kind()};
  const NodeFormat& depth = source->streams_[Pairing::kDepth]->format();
  source->info_.camera = *options.camera;
  source->info_.camera.k.width = depth.cols;
  source->info_.camera.k.height = depth.rows;
  source->other_size_ = fmt::format("{}: its images have {}x{} pixels, memory of another size was given",
                                    source->info_.name, depth.cols, depth.rows);
  if (const std::string problem = camera_problem(source->info_.camera); !problem.empty())
    return bad(
        fmt::format("{}: images of {}x{} and these intrinsics: {}; give those of this size with --camera, or "
                    "ask for another size with source.cols and source.rows",
                    source->info_.name, depth.cols, depth.rows, problem));
  return source;
}

/// The size of the depth image is negotiated once; colour, and what is opened again, has to have the same.
Result<Done> V4l2Source::open_nodes() {
  const Intrinsics& agreed = info_.camera.k;
  NodeRequest request;
  request.rate_hz = static_cast<double>(options_.rate_hz);
  request.auto_exposure = options_.auto_exposure;
  request.auto_white_balance = options_.auto_white_balance;
  request.path = nodes_.depth;
  request.exact_size = agreed.width > 0;
  request.cols = request.exact_size ? agreed.width : options_.cols;
  request.rows = request.exact_size ? agreed.height : options_.rows;
  auto depth = ImageStream::open(calls_, request);
  if (!depth) return Error{depth.error(), depth.error_kind()};
  if (!nodes_.colour.empty()) {
    request.path = nodes_.colour;
    request.kind = ImageKind::colour;
    request.exact_size = true;
    request.cols = (*depth)->format().cols;
    request.rows = (*depth)->format().rows;
    auto colour = ImageStream::open(calls_, request);
    if (!colour) return Error{colour.error(), colour.error_kind()};
    streams_[Pairing::kColour] = std::move(*colour);
  }
  streams_[Pairing::kDepth] = std::move(*depth);
  in_trouble_ = {};
  fresh_ = true;
  return Done{};
}

void V4l2Source::close_nodes() {
  pairing_.clear([&](Pairing::Kind kind, int32_t handle) { release(kind, handle); });
  if (streams_[Pairing::kDepth]) lost_before_ += streams_[Pairing::kDepth]->lost();
  for (auto& stream : streams_) stream.reset();
}

Status V4l2Source::reopen() {
  close_nodes();
  if (const auto opened = open_nodes(); !opened) {
    closed_ = opened.error();
    return fail(Status::unavailable, closed_);
  }
  return Status::ok;
}

Status V4l2Source::next(RgbdFrame& frame, int32_t timeout_ms) {
  if (!streams_[Pairing::kDepth]) return fail(Status::unavailable, closed_);
  const Intrinsics& k = info_.camera.k;
  if (frame.depth_raw.cols != k.width || frame.depth_raw.rows != k.height || frame.colour.cols != k.width ||
      frame.colour.rows != k.height)
    return fail(Status::bad_data, other_size_);
  if (fresh_) begin();
  const int64_t until_ns = monotonic_ns() + int64_t{timeout_ms} * 1'000'000;
  for (;;) {
    if (const Status status = take_frame(frame); status != Status::timeout) return status;
    const int64_t now_ns = monotonic_ns();
    if (now_ns - last_frame_ns_ > nanoseconds(1e3 * options_.gone_s))
      return fail(Status::unavailable, silent_);
    if (now_ns >= until_ns) return Status::timeout;
    wait(until_ns);
  }
}

/// What came before anybody asked is old: the first frame is one that comes from here on.
void V4l2Source::begin() {
  for (auto& stream : streams_)
    if (stream) stream->discard();
  last_frame_ns_ = monotonic_ns();
  fresh_ = false;
}

/// Takes images, in turn, until two make a frame or no more are there.
Status V4l2Source::take_frame(RgbdFrame& frame) {
  for (uint32_t round = 0; round < CaptureNode::kBuffers; ++round) {
    bool any = false;
    for (const Pairing::Kind kind : {Pairing::kDepth, Pairing::kColour}) {
      if (!streams_[kind]) continue;
      const Status status = take_image(kind, frame, any);
      if (status != Status::timeout) return status;
    }
    if (!any) break;
  }
  return Status::timeout;
}

/// @param any set when an image was there
/// @return ok: the frame is complete; timeout: not yet
Status V4l2Source::take_image(Pairing::Kind kind, RgbdFrame& frame, bool& any) {
  ImageStream::Image image;
  const Status status = streams_[kind]->take(image, in_trouble_[kind]);
  if (status == Status::timeout) return status;
  if (status != Status::ok) {
    sequence_ += status == Status::bad_data;
    return fail(status, status == Status::bad_data ? damaged_[kind] : gone_[kind]);
  }
  any = true;
  if (kind == Pairing::kColour) image.stamp_ns += nanoseconds(options_.time_offset_ms);
  Pairing::Pair pair;
  if (!streams_[Pairing::kColour])
    pair.depth = {image.stamp_ns, image.handle};
  else if (!pairing_.add(kind, image.stamp_ns, image.handle, pair,
                         [&](Pairing::Kind of, int32_t handle) { release(of, handle); }))
    return Status::timeout;
  deliver(pair, frame);
  if (to_skip_ == 0) return Status::ok;
  --to_skip_;
  return Status::timeout;
}

void V4l2Source::deliver(const Pairing::Pair& pair, RgbdFrame& frame) {
  frame.depth_stamp = frame.captured = {pair.depth.stamp_ns};
  frame.sequence = sequence_++;
  streams_[Pairing::kDepth]->copy(pair.depth.image, frame.depth_raw);
  release(Pairing::kDepth, pair.depth.image);
  if (streams_[Pairing::kColour]) {
    frame.colour_stamp = {pair.colour.stamp_ns};
    streams_[Pairing::kColour]->copy(pair.colour.image, frame.colour);
    release(Pairing::kColour, pair.colour.image);
  } else {
    frame.colour_stamp = frame.depth_stamp;
    fill_mid_grey(frame.colour);
  }
  last_frame_ns_ = monotonic_ns();
}

void V4l2Source::release(Pairing::Kind kind, int32_t handle) {
  if (streams_[kind]) streams_[kind]->release(handle);
}

void V4l2Source::wait(int64_t until_ns) {
  pollfd fds[2 * ImageStream::kDescriptors];
  uint32_t count = 0;
  std::array<uint32_t, 2> first{};
  for (const Pairing::Kind kind : {Pairing::kDepth, Pairing::kColour}) {
    if (!streams_[kind]) continue;
    pollfd own[ImageStream::kDescriptors];
    const uint32_t filled = streams_[kind]->descriptors(own);
    first[kind] = count;
    for (uint32_t i = 0; i < filled; ++i) fds[count++] = own[i];
  }
  const int64_t left_ns = std::max<int64_t>(until_ns - monotonic_ns(), 0);
  const int ready = calls_.poll(fds, count, static_cast<int32_t>((left_ns + 999'999) / 1'000'000));
  for (const Pairing::Kind kind : {Pairing::kDepth, Pairing::kColour}) {
    const bool reported = ready > 0 && (fds[first[kind]].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
    in_trouble_[kind] = streams_[kind] && (reported || ready < 0);
  }
}

Status V4l2Source::fail(Status status, const std::string& why) {
  error_ = &why;
  return status;
}

uint32_t V4l2Source::left_out() const {
  const auto& depth = streams_[Pairing::kDepth];
  return lost_before_ + (depth ? depth->lost() : 0) + pairing_.unpaired(Pairing::kDepth);
}

std::string V4l2Source::formats_text() const {
  std::string text;
  for (const auto& stream : streams_)
    if (stream) text += fmt::format("{}{}", text.empty() ? "" : ", ", format_text(stream->format()));
  return text;
}

Result<std::unique_ptr<FrameSource>> open_v4l2(const std::string& rest, const CameraOptions& options,
                                               SystemCalls& calls) {
  const size_t comma = rest.find(',');
  const V4l2Source::Nodes nodes{rest.substr(0, comma),
                                comma == std::string::npos ? "" : rest.substr(comma + 1)};
  const bool two = comma != std::string::npos;
  if (nodes.depth.empty() || (two && nodes.colour.empty()) || nodes.colour.find(',') != std::string::npos ||
      nodes.depth == nodes.colour)
    return bad(
        "v4l2: expected v4l2:DEPTH_DEV or v4l2:DEPTH_DEV,COLOUR_DEV with two nodes, such as "
        "v4l2:/dev/video0,/dev/video2, not 'v4l2:" +
        rest + "'");
  auto source = V4l2Source::open(nodes, options, calls);
  if (!source) return Error{source.error(), source.error_kind()};
  return std::unique_ptr<FrameSource>(std::move(*source));
}

}  // namespace stillmap
