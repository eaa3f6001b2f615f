#include <filesystem>
#include <utility>

#include "drivers/openni2/library.hpp"
#include "drivers/openni2/openni2_source.hpp"
#include "drivers/openni2/recording_file.hpp"
#include "drivers/openni2/rgbd_device.hpp"

namespace stillmap {
namespace {

using openni2::RgbdDevice;
using Read = RgbdDevice::Read;

/// The player decodes an image in milliseconds. What is asked for again while it is at work may overtake it,
/// so that one wait is long.
constexpr int32_t kWaitMs = 2000;
constexpr int kMostWaits = 5;

class OniSource final : public FrameSource {
 public:
  OniSource(const std::string& path, std::unique_ptr<RgbdDevice> device)
      : path_(path), device_(std::move(device)) {
    info_.name = "oni:" + path;
    info_.camera = device_->camera();
    info_.depth_units_per_m = device_->depth_units_per_m();
    info_.frames = device_->frames();
  }

  const SourceInfo& info() const override { return info_; }
  const std::string& error() const override { return error_; }
  uint32_t left_out() const override { return device_->missed(); }

  Status next(RgbdFrame& frame, int32_t /*timeout_ms*/) override {
    const Status status = next_pair();
    if (status != Status::ok && status != Status::bad_data) return status;
    frame.sequence = sequence_++;
    if (status != Status::ok) return status;
    const Intrinsics& k = info_.camera.k;
    if (frame.depth_raw.rows != k.height || frame.depth_raw.cols != k.width ||
        frame.colour.rows != k.height || frame.colour.cols != k.width)
      return passed_over("the images given to it have another size than it announced");
    frame.depth_stamp = {device_->stamps().depth_ns};
    frame.colour_stamp = {device_->stamps().colour_ns};
    frame.truth_T_world_cam.reset();
    device_->copy_to(frame);
    return Status::ok;
  }

  void skip(uint32_t count) override {
    for (uint32_t i = 0; i < count; ++i) {
      const Status status = next_pair();
      if (status == Status::ok) device_->drop();
      if (status != Status::ok && status != Status::bad_data) return;
      ++sequence_;
    }
  }

 private:
  /// @return ok: a pair stands ready
  Status next_pair() {
    for (int waits = 0; waits < kMostWaits;) switch (device_->read(kWaitMs)) {
        case Read::pair:
          return Status::ok;
        case Read::unpaired:
        case Read::bad:
          return passed_over(device_->error());
        case Read::end:
          return Status::end;
        case Read::gone:
          waits = kMostWaits;
          break;
        case Read::nothing:
          ++waits;
          break;
        case Read::single:
          break;
      }
    passed_over("OpenNI2's player gives no more images, though there should be some");
    return Status::unavailable;
  }
  Status passed_over(const std::string& why) {
    error_ = path_ + ": frame " + std::to_string(sequence_) + ": " + why;
    return Status::bad_data;
  }

  const std::string path_;
  std::unique_ptr<RgbdDevice> device_;
  SourceInfo info_;
  uint32_t sequence_ = 0;
  std::string error_;
};

}  // namespace

Result<std::unique_ptr<FrameSource>> open_oni(const std::string& path, const CameraOptions& options) {
  const auto cannot_open = [](std::string why) { return Error{std::move(why), ErrorKind::cannot_open}; };
  if (std::string wrong = openni2::recording_problem(path); !wrong.empty())
    return cannot_open(std::move(wrong));
  constexpr size_t kLongestUri = 255;
  std::error_code error;
  const std::string absolute = std::filesystem::absolute(path, error).string();
  if (error || absolute.size() > kLongestUri)
    return cannot_open(path + ": OpenNI2 takes paths of " + std::to_string(kLongestUri) +
                       " bytes and less, the folders from the root on included; move it or make a link");
  if (const auto started = openni2::start_library(); !started) return cannot_open("oni: " + started.error());
  auto device = RgbdDevice::open(absolute, RgbdDevice::Kind::recording, options);
  if (!device) return cannot_open(path + ": " + device.error());
  return std::unique_ptr<FrameSource>(std::make_unique<OniSource>(path, std::move(*device)));
}

}  // namespace stillmap
