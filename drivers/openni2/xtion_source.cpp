#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/camera/device_clock.hpp"
#include "drivers/openni2/openni2_source.hpp"
#include "drivers/openni2/rgbd_device.hpp"
#include "runtime/core/clock.hpp"

namespace stillmap {
namespace {

using openni2::RgbdDevice;
using Read = RgbdDevice::Read;

constexpr int64_t kNsPerMs = 1'000'000;
constexpr int kMostReads = 64;  ///< images in one call of `next`
constexpr const char* kAsk = "; `stillmap doctor --source xtion` says more";

class XtionSource final : public FrameSource {
 public:
  XtionSource(std::string serial, const CameraOptions& options)
      : serial_(std::move(serial)), options_(options) {
    info_.name = serial_.empty() ? "xtion" : "xtion:" + serial_;
    error_.reserve(kErrorBytes);
  }

  /// @return what went wrong; empty: it runs
  std::string open() {
    device_.reset();
    const auto uri = openni2::find_camera(serial_);
    if (!uri) return info_.name + ": " + uri.error() + kAsk;
    auto device = RgbdDevice::open(*uri, RgbdDevice::Kind::camera, options_);
    if (!device) return info_.name + ": " + device.error() + kAsk;
    device_ = std::move(*device);
    clock_.restart();
    waited_ns_ = 0;
    left_out_before_ = left_out_;
    return {};
  }
  void learn_about_it() {
    info_.camera = device_->camera();
    info_.depth_units_per_m = device_->depth_units_per_m();
    if (serial_.empty()) serial_ = device_->serial();  // the one to come back
  }

  const SourceInfo& info() const override { return info_; }
  bool live() const override { return true; }
  uint32_t left_out() const override { return left_out_; }
  const std::string& error() const override { return error_; }

  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  Status reopen() override {
    std::string wrong = open();
    if (wrong.empty()) return Status::ok;
    error_ = std::move(wrong);
    return Status::unavailable;
  }
  void skip(uint32_t count) override {
    for (uint32_t skipped = 0; skipped < count && device_;) {
      const Status status = next_pair(kSkipWaitMs);
      if (status == Status::unavailable || status == Status::timeout) return;
      if (status == Status::ok) device_->drop();
      ++skipped;
      ++sequence_;
    }
  }

 private:
  static constexpr size_t kErrorBytes = 512;
  static constexpr int32_t kSkipWaitMs = 1000;

  Status next_pair(int32_t timeout_ms);
  Status deliver(RgbdFrame& frame);
  Status gone(const char* why);
  Status passed_over(const char* why);
  bool fits(const RgbdFrame& frame) const;

  std::string serial_;
  const CameraOptions options_;
  SourceInfo info_;
  std::unique_ptr<RgbdDevice> device_;  ///< null: gone, and not closed any more
  DeviceClock clock_;
  uint32_t sequence_ = 0;
  uint32_t left_out_ = 0, left_out_before_ = 0;  ///< before: when the device was opened
  int64_t waited_ns_ = 0;                        ///< since the last pair
  std::string error_;                            ///< has room for every text of `next`
};

Status XtionSource::next(RgbdFrame& frame, int32_t timeout_ms) {
  if (!device_) return Status::unavailable;
  if (!fits(frame)) return passed_over("the images given to it have another size than it announced");
  const Status status = next_pair(timeout_ms);
  if (status == Status::bad_data) ++sequence_;
  return status == Status::ok ? deliver(frame) : status;
}

/// @return ok: a pair stands ready
Status XtionSource::next_pair(int32_t timeout_ms) {
  const int64_t start_ns = monotonic_ns();
  int64_t spent_ns = 0;
  for (int i = 0; i < kMostReads; ++i) {
    const int64_t left_ns = std::max<int64_t>(0, int64_t{timeout_ms} * kNsPerMs - spent_ns);
    const Read read = device_->read(static_cast<int32_t>(left_ns / kNsPerMs));
    spent_ns = monotonic_ns() - start_ns;
    switch (read) {
      case Read::pair:
        waited_ns_ = 0;
        return Status::ok;
      case Read::unpaired:
      case Read::bad:
        waited_ns_ += spent_ns;
        if (static_cast<double>(waited_ns_) * 1e-9 >= options_.gone_s)
          return gone("no usable pair of images");
        return passed_over(device_->error().c_str());
      case Read::gone:
      case Read::end:
        return gone("the camera was unplugged or failed");
      case Read::single:
      case Read::nothing:
        break;
    }
    if (spent_ns / kNsPerMs >= timeout_ms) break;
  }
  waited_ns_ += spent_ns;
  if (static_cast<double>(waited_ns_) * 1e-9 < options_.gone_s) return Status::timeout;
  return gone(!device_->depth_comes()    ? "the camera sends no depth images any more"
              : !device_->colour_comes() ? "the camera sends depth, but no colour images any more"
                                         : "depth and colour do not come at the same time any more");
}

Status XtionSource::deliver(RgbdFrame& frame) {
  const RgbdDevice::Stamps stamps = device_->stamps();
  const DeviceClock::Mapped taken = clock_.map(stamps.depth_ns, stamps.arrived_ns);
  left_out_ = left_out_before_ + device_->missed();
  frame.sequence = sequence_++ + left_out_;
  if (taken.jumped) {
    device_->drop();
    return passed_over("the camera's clock jumped");
  }
  device_->copy_to(frame);
  frame.captured = frame.depth_stamp = {taken.monotonic_ns};
  frame.colour_stamp = {taken.monotonic_ns + stamps.colour_ns - stamps.depth_ns};
  frame.truth_T_world_cam.reset();
  return Status::ok;
}

/// Closing takes time: that is for `reopen`.
Status XtionSource::gone(const char* why) {
  passed_over(why);
  return Status::unavailable;
}

/// Does not allocate: there is room.
Status XtionSource::passed_over(const char* why) {
  error_.assign(info_.name, 0, kErrorBytes / 2);
  error_.append(": ").append(why);
  return Status::bad_data;
}

bool XtionSource::fits(const RgbdFrame& frame) const {
  const Intrinsics& k = info_.camera.k;
  const auto is_right = [&k](const auto& image) {
    return image.data != nullptr && image.rows == k.height && image.cols == k.width && image.pitch >= k.width;
  };
  return is_right(frame.depth_raw) && is_right(frame.colour);
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_xtion(const std::string& serial, const CameraOptions& options) {
  auto source = std::make_unique<XtionSource>(serial, options);
  if (std::string wrong = source->open(); !wrong.empty())
    return Error{std::move(wrong), ErrorKind::cannot_open};
  source->learn_about_it();
  return std::unique_ptr<FrameSource>(std::move(source));
}

}  // namespace stillmap
