// A driver module of OpenNI2 with one camera, like an Xtion, that is not there: it sends the images of a file
// at its frame rate and misbehaves when told to (virtual_camera.hpp). The library loads it like any other.

#include <Driver/OniDriverAPI.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <new>
#include <thread>

#include "tests/drivers/openni2/virtual_camera.hpp"

#define XN_NEW(T, ...) new (std::nothrow) T(__VA_ARGS__)
#define XN_DELETE(p) delete (p)

namespace {

using namespace stillmap::virtual_camera;
using std::chrono::microseconds;
using Clock = std::chrono::steady_clock;

constexpr int kUsbVendor = 0x1d27, kUsbProduct = 0x0601;
constexpr int kUsualRate = 30;
constexpr std::chrono::milliseconds kPoll{2};

class Stream : public oni::driver::StreamBase {
 public:
  Stream(OniSensorType sensor, const Frames& frames, Control& control)
      : sensor_(sensor), frames_(frames), control_(control) {
    mode_ = {sensor == ONI_SENSOR_DEPTH ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_RGB888,
             frames.header().cols, frames.header().rows, kUsualRate};
  }

  OniStatus start() override {
    const std::lock_guard lock(mutex_);
    running_ = true;
    if (sensor_ == ONI_SENSOR_DEPTH) control_.registered = 0;  // as with the real one
    return ONI_STATUS_OK;
  }
  void stop() override {
    const std::lock_guard lock(mutex_);
    running_ = false;
  }
  int rate() const { return mode_.fps; }
  bool running() {
    const std::lock_guard lock(mutex_);
    return running_;
  }

  /// @param moment counts on, also while nothing is sent
  /// @param small half the width
  void send(int moment, int image, int64_t stamp_us, bool small) {
    const std::lock_guard lock(mutex_);
    if (!running_) return;
    OniFrame* const frame = getServices().acquireFrame();
    if (frame == nullptr) return;
    const bool depth = sensor_ == ONI_SENSOR_DEPTH;
    frame->frameIndex = moment + 1;
    frame->videoMode = mode_;
    frame->width = small ? mode_.resolutionX / 2 : mode_.resolutionX;
    frame->height = mode_.resolutionY;
    frame->stride = frame->width * bytes_of_pixel();
    frame->cropOriginX = frame->cropOriginY = 0;
    frame->croppingEnabled = FALSE;
    frame->sensorType = sensor_;
    frame->timestamp = static_cast<uint64_t>(stamp_us);
    frame->dataSize = frame->stride * frame->height;
    std::memcpy(frame->data, depth ? frames_.depth(image) : frames_.colour(image),
                static_cast<size_t>(frame->dataSize));
    raiseNewFrame(frame);
    getServices().releaseFrame(frame);
  }

  OniBool isPropertySupported(int id) override {
    std::array<char, 64> value;
    int size = value.size();
    return getProperty(id, value.data(), &size) == ONI_STATUS_OK;
  }
  OniStatus getProperty(int id, void* data, int* size) override {
    const bool depth = sensor_ == ONI_SENSOR_DEPTH;
    switch (id) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE:
        return put(data, size, mode_);
      case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
        return put(data, size, frames_.header().horizontal_fov_rad);
      case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        return put(data, size, frames_.header().vertical_fov_rad);
      case ONI_STREAM_PROPERTY_MIRRORING:
        return put<OniBool>(data, size, mirrored_);
      case ONI_STREAM_PROPERTY_STRIDE:
        return put<int>(data, size, mode_.resolutionX * bytes_of_pixel());
      case ONI_STREAM_PROPERTY_CROPPING:
        return put(data, size, OniCropping{FALSE, 0, 0, mode_.resolutionX, mode_.resolutionY});
      case ONI_STREAM_PROPERTY_MAX_VALUE:
        return depth ? put<int>(data, size, 65535) : ONI_STATUS_NOT_SUPPORTED;
      case ONI_STREAM_PROPERTY_MIN_VALUE:
        return depth ? put<int>(data, size, 0) : ONI_STATUS_NOT_SUPPORTED;
      case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
        return depth ? ONI_STATUS_NOT_SUPPORTED : put<OniBool>(data, size, control_.auto_exposure);
      case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE:
        return depth ? ONI_STATUS_NOT_SUPPORTED : put<OniBool>(data, size, control_.auto_white_balance);
      default:
        return ONI_STATUS_NOT_SUPPORTED;
    }
  }
  OniStatus setProperty(int id, const void* data, int size) override {
    switch (id) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE: {
        OniVideoMode asked;
        if (size != sizeof asked) return ONI_STATUS_BAD_PARAMETER;
        std::memcpy(&asked, data, sizeof asked);
        if (asked.resolutionX != mode_.resolutionX || asked.resolutionY != mode_.resolutionY ||
            asked.pixelFormat != mode_.pixelFormat)
          return ONI_STATUS_NOT_SUPPORTED;
        mode_ = asked;
        raisePropertyChanged(id, data, size);
        return ONI_STATUS_OK;
      }
      case ONI_STREAM_PROPERTY_MIRRORING:
        mirrored_ = truth_of(data);
        control_.mirrored = mirrored_;
        raisePropertyChanged(id, data, size);
        return ONI_STATUS_OK;
      case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
        control_.auto_exposure = truth_of(data);
        return ONI_STATUS_OK;
      case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE:
        control_.auto_white_balance = truth_of(data);
        return ONI_STATUS_OK;
      default:
        return ONI_STATUS_NOT_SUPPORTED;
    }
  }
  /// What a recorder keeps. Without mode, stride and cropping its player drops every image.
  void notifyAllProperties() override {
    for (const int id :
         {ONI_STREAM_PROPERTY_VIDEO_MODE, ONI_STREAM_PROPERTY_HORIZONTAL_FOV,
          ONI_STREAM_PROPERTY_VERTICAL_FOV, ONI_STREAM_PROPERTY_MIRRORING, ONI_STREAM_PROPERTY_STRIDE,
          ONI_STREAM_PROPERTY_CROPPING, ONI_STREAM_PROPERTY_MAX_VALUE, ONI_STREAM_PROPERTY_MIN_VALUE}) {
      std::array<char, 64> value;
      int size = value.size();
      if (getProperty(id, value.data(), &size) == ONI_STATUS_OK) raisePropertyChanged(id, value.data(), size);
    }
  }

 private:
  template <class T>
  static OniStatus put(void* data, int* size, T value) {
    if (*size < static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(data, &value, sizeof value);
    *size = sizeof value;
    return ONI_STATUS_OK;
  }
  static OniBool truth_of(const void* data) { return *static_cast<const OniBool*>(data) != 0; }
  int bytes_of_pixel() const { return sensor_ == ONI_SENSOR_DEPTH ? 2 : 3; }

  const OniSensorType sensor_;
  const Frames& frames_;
  Control& control_;
  OniVideoMode mode_;
  OniBool mirrored_ = TRUE;  // as the real one comes out of its box
  std::mutex mutex_;
  bool running_ = false;
};

class Camera : public oni::driver::DeviceBase {
 public:
  Camera(const char* frames_path, Control& control) : frames_(frames_path), control_(control) {
    const FramesHeader& h = frames_.header();
    modes_ = {OniVideoMode{ONI_PIXEL_FORMAT_DEPTH_1_MM, h.cols, h.rows, kUsualRate},
              OniVideoMode{ONI_PIXEL_FORMAT_RGB888, h.cols, h.rows, kUsualRate}};
    sensors_ = {OniSensorInfo{ONI_SENSOR_DEPTH, 1, &modes_[0]},
                OniSensorInfo{ONI_SENSOR_COLOR, 1, &modes_[1]}};
    control_.sent = 0;
    ++control_.opened;
    sender_ = std::jthread([this](const std::stop_token& stop) { send_all(stop); });
  }
  bool usable() const { return frames_.header().count > 0; }

  OniStatus getSensorInfoList(OniSensorInfo** infos, int* count) override {
    *infos = sensors_.data();
    *count = static_cast<int>(sensors_.size());
    return ONI_STATUS_OK;
  }
  oni::driver::StreamBase* createStream(OniSensorType sensor) override {
    if (sensor != ONI_SENSOR_DEPTH && sensor != ONI_SENSOR_COLOR) return nullptr;
    const std::lock_guard lock(mutex_);
    return (sensor == ONI_SENSOR_DEPTH ? depth_ : colour_) =
               new (std::nothrow) Stream(sensor, frames_, control_);
  }
  void destroyStream(oni::driver::StreamBase* stream) override {
    const std::lock_guard lock(mutex_);
    if (stream == depth_) depth_ = nullptr;
    if (stream == colour_) colour_ = nullptr;
    delete stream;
  }
  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override {
    return mode == ONI_IMAGE_REGISTRATION_OFF || control_.registration != kUnsupported;
  }
  OniBool isPropertySupported(int id) override {
    return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION || id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER;
  }
  OniStatus getProperty(int id, void* data, int* size) override {
    if (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) {
      const auto mode =
          control_.registered ? ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR : ONI_IMAGE_REGISTRATION_OFF;
      std::memcpy(data, &mode, sizeof mode);
      *size = sizeof mode;
      return ONI_STATUS_OK;
    }
    if (id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER && *size > static_cast<int>(std::strlen(kSerial))) {
      std::strcpy(static_cast<char*>(data), kSerial);
      *size = static_cast<int>(std::strlen(kSerial)) + 1;
      return ONI_STATUS_OK;
    }
    return ONI_STATUS_NOT_SUPPORTED;
  }
  OniStatus setProperty(int id, const void* data, int) override {
    if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_SUPPORTED;
    if (control_.registration == kRefuses) return ONI_STATUS_ERROR;
    const auto mode = *static_cast<const OniImageRegistrationMode*>(data);
    if (control_.registration == kObeys) control_.registered = mode == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    return ONI_STATUS_OK;
  }

 private:
  /// Both images of a moment, one after the other, as long as it is open.
  void send_all(const std::stop_token& stop) {
    int moment = 0, images = 0;
    auto due = Clock::now();
    while (!stop.stop_requested()) {
      const int rate = running_rate();
      if (rate == 0 || control_.hold || !control_.plugged) {
        std::this_thread::sleep_for(kPoll);
        due = Clock::now();
        continue;
      }
      if (control_.unpaced && images == frames_.header().count) {
        std::this_thread::sleep_for(kPoll);
        continue;
      }
      if (!control_.unpaced) {
        due += microseconds(1'000'000 / rate);
        std::this_thread::sleep_until(due);
      }
      if (!control_.stalled) send(moment, frames_.image_of(images++), rate);
      ++moment;
    }
  }
  void send(int moment, int image, int rate) {
    const int64_t stamp_us =
        (int64_t{moment} * 1'000'000 + rate / 2) / rate + int64_t{control_.stamp_shift_ms} * 1000;
    const bool small = control_.small_images > 0;
    if (small) --control_.small_images;
    const std::lock_guard lock(mutex_);
    if (depth_) depth_->send(moment, image, stamp_us, small);
    ++control_.sent;
    if (colour_ && !control_.no_colour)
      colour_->send(moment, image, stamp_us + int64_t{control_.colour_shift_ms} * 1000, false);
  }
  /// 0 until both streams run.
  int running_rate() {
    const std::lock_guard lock(mutex_);
    return depth_ && colour_ && depth_->running() && colour_->running() ? depth_->rate() : 0;
  }

  const Frames frames_;
  Control& control_;
  std::array<OniVideoMode, 2> modes_;
  std::array<OniSensorInfo, 2> sensors_;
  std::mutex mutex_;
  Stream* depth_ = nullptr;
  Stream* colour_ = nullptr;
  std::jthread sender_;  // ends before what it uses
};

class VirtualDriver : public oni::driver::DriverBase {
 public:
  explicit VirtualDriver(OniDriverServices* services)
      : DriverBase(services), control_file_(std::getenv(kControlVariable), true) {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    if (control_file_.size() < sizeof(Control)) return ONI_STATUS_ERROR;
    DriverBase::initialize(connected, disconnected, changed, cookie);
    follow_plug();
    watcher_ = std::jthread([this](const std::stop_token& stop) {
      for (; !stop.stop_requested(); std::this_thread::sleep_for(kPoll)) follow_plug();
    });
    return ONI_STATUS_OK;
  }
  OniStatus tryDevice(const char*) override { return ONI_STATUS_ERROR; }
  oni::driver::DeviceBase* deviceOpen(const char* uri, const char*) override {
    if (!control().plugged || std::strcmp(uri, info_.uri) != 0) return nullptr;
    std::printf("a driver prints to stdout\n");  // as that of the Xtion does when it may not set a priority
    auto camera = std::make_unique<Camera>(std::getenv(kFramesVariable), control());
    return camera->usable() ? camera.release() : nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }
  void* enableFrameSync(oni::driver::StreamBase**, int) override {
    return control().no_sync ? nullptr : this;
  }
  void shutdown() override { watcher_ = {}; }

 private:
  Control& control() { return *static_cast<Control*>(control_file_.memory()); }

  /// Each time it is plugged in it is another one on the bus.
  void follow_plug() {
    const bool plugged = control().plugged != 0;
    if (plugged == plugged_) return;
    plugged_ = plugged;
    if (!plugged) {
      deviceStateChanged(&info_, ONI_DEVICE_STATE_ERROR);
      deviceDisconnected(&info_);
      return;
    }
    info_ = {};
    std::strcpy(info_.uri, ("virtual:" + std::to_string(++times_plugged_)).c_str());
    std::strcpy(info_.vendor, "Stillmap");
    std::strcpy(info_.name, "virtual camera");
    info_.usbVendorId = kUsbVendor;
    info_.usbProductId = kUsbProduct;
    deviceConnected(&info_);
    deviceStateChanged(&info_, ONI_DEVICE_STATE_OK);
  }

  Mapped control_file_;
  OniDeviceInfo info_{};
  bool plugged_ = false;
  int times_plugged_ = 0;
  std::jthread watcher_;
};

}  // namespace

ONI_EXPORT_DRIVER(VirtualDriver)
