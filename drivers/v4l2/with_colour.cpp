#include "drivers/v4l2/with_colour.hpp"

#include <fmt/format.h>

#include <cmath>

#include "runtime/core/clock.hpp"

namespace stillmap {

WithColour::WithColour(std::unique_ptr<FrameSource> depth, std::string node, const CameraOptions& options,
                       SystemCalls& calls)
    : depth_(std::move(depth)),
      node_(std::move(node)),
      options_(options),
      calls_(calls),
      info_(depth_->info()),
      pairing_(std::llround(options.max_pair_ms * 1e6)) {
  info_.name = fmt::format("v4l2:{},{}", info_.name, node_);
  no_colour_ =
      fmt::format("{}: no colour image within {:.3g} ms of the depth image; source.max_pair_ms is that bound",
                  node_, options.max_pair_ms);
  gone_ = node_ + ": the camera is gone; plug it in again, `dmesg` says why";
}

WithColour::~WithColour() {
  close_colour();
}

Result<std::unique_ptr<WithColour>> WithColour::open(std::unique_ptr<FrameSource> depth,
                                                     const std::string& colour_node,
                                                     const CameraOptions& options, SystemCalls& calls) {
  std::unique_ptr<WithColour> source(new WithColour(std::move(depth), colour_node, options, calls));
  if (const auto opened = source->open_colour(); !opened) return Error{opened.error(), opened.error_kind()};
  return source;
}

Result<Done> WithColour::open_colour() {
  NodeRequest request;
  request.path = node_;
  request.kind = ImageKind::colour;
  request.cols = info_.camera.k.width;
  request.rows = info_.camera.k.height;
  request.exact_size = true;
  request.rate_hz = static_cast<double>(options_.rate_hz);
  request.auto_exposure = options_.auto_exposure;
  request.auto_white_balance = options_.auto_white_balance;
  auto colour = ImageStream::open(calls_, request);
  if (!colour) return Error{colour.error(), colour.error_kind()};
  colour_ = std::move(*colour);
  in_trouble_ = false;
  fresh_ = true;
  return Done{};
}

void WithColour::close_colour() {
  pairing_.clear([&](Pairing::Kind kind, int32_t handle) { release(kind, handle); });
  colour_.reset();
}

Status WithColour::reopen() {
  error_ = nullptr;
  if (depth_gone_)
    if (const Status status = depth_->reopen(); status != Status::ok) return status;
  depth_gone_ = false;
  if (colour_) return Status::ok;
  if (const auto opened = open_colour(); !opened) {
    closed_ = opened.error();
    error_ = &closed_;
    return Status::unavailable;
  }
  return Status::ok;
}

Status WithColour::next(RgbdFrame& frame, int32_t timeout_ms) {
  if (!colour_) return Status::unavailable;  // it was said why
  if (fresh_) colour_->discard();
  fresh_ = false;
  error_ = nullptr;
  const Status status = depth_->next(frame, timeout_ms);
  depth_gone_ = status == Status::unavailable;
  if (status != Status::ok) return status;
  Pairing::Pair pair;
  const Status found = find_colour(frame.captured.ns, pair);
  if (found == Status::ok) {
    frame.colour_stamp.ns = frame.depth_stamp.ns + pair.colour.stamp_ns - pair.depth.stamp_ns;
    colour_->copy(pair.colour.image, frame.colour);
    colour_->release(pair.colour.image);
    return Status::ok;
  }
  error_ = found == Status::unavailable ? &gone_ : &no_colour_;
  if (found == Status::unavailable)
    close_colour();
  else  // the next frame's depth image comes into the same memory
    pairing_.clear([&](Pairing::Kind kind, int32_t handle) { release(kind, handle); });
  return found;
}

/// @return ok; bad_data: none came in time; unavailable
Status WithColour::find_colour(int64_t captured_ns, Pairing::Pair& pair) {
  const auto give_up = [&](Pairing::Kind kind, int32_t handle) { release(kind, handle); };
  const int64_t until_ns = monotonic_ns() + std::llround(options_.max_pair_ms * 1e6);
  // What came while the depth image was waited for.
  for (uint32_t i = 0; i < CaptureNode::kBuffers; ++i) {
    const Status status = take_colour(pair);
    if (status == Status::unavailable) return status;
    if (status == Status::timeout) break;
  }
  if (pairing_.add(Pairing::kDepth, captured_ns, kNoImage, pair, give_up)) return Status::ok;
  for (;;) {
    const Status status = take_colour(pair);
    if (status == Status::ok && pair.colour.image >= 0) return Status::ok;
    if (status == Status::unavailable) return status;
    const int64_t left_ns = until_ns - monotonic_ns();
    if (left_ns <= 0) return Status::bad_data;
    if (status != Status::timeout) continue;  // there may be another one
    pollfd fds[ImageStream::kDescriptors];
    const uint32_t count = colour_->descriptors(fds);
    const int ready = calls_.poll(fds, count, static_cast<int32_t>((left_ns + 999'999) / 1'000'000));
    in_trouble_ = ready < 0 || (ready > 0 && (fds[0].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0);
  }
}

/// @return ok: one was taken, and made a pair where `pair` has a colour image; timeout: none is there;
///         bad_data: one came damaged; unavailable
Status WithColour::take_colour(Pairing::Pair& pair) {
  ImageStream::Image image;
  const Status status = colour_->take(image, in_trouble_);
  if (status != Status::ok) return status;
  pair.colour.image = kNoImage;
  pairing_.add(Pairing::kColour, image.stamp_ns + std::llround(options_.time_offset_ms * 1e6), image.handle,
               pair, [&](Pairing::Kind kind, int32_t handle) { release(kind, handle); });
  return Status::ok;
}

void WithColour::release(Pairing::Kind kind, int32_t handle) {
  if (kind == Pairing::kColour && colour_) colour_->release(handle);
}

}  // namespace stillmap
