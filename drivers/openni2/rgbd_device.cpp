#include "drivers/openni2/rgbd_device.hpp"

#include <OpenNI.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <utility>

#include "drivers/camera/frame_pairing.hpp"
#include "drivers/openni2/library.hpp"
#include "drivers/openni2/openni2_source.hpp"
#include "runtime/core/clock.hpp"

namespace stillmap::openni2 {
namespace {

using ::openni::VideoFrameRef;
using ::openni::VideoMode;
using ::openni::VideoStream;
using Pairing = FramePairing<VideoFrameRef>;

constexpr int kMostMissed = 1000;  ///< a larger gap in the numbers is a new count
constexpr size_t kErrorBytes = 256;

Error cannot_open(std::string message) {
  return {std::move(message), ErrorKind::cannot_open};
}

void warn(const std::string& text) {
  std::fprintf(stderr, "stillmap: %s\n", text.c_str());
}

/// What the library tells of one device, from threads of its own.
class DeviceWatch final : public ::openni::OpenNI::DeviceDisconnectedListener,
                          public ::openni::OpenNI::DeviceStateChangedListener {
 public:
  explicit DeviceWatch(std::string uri) : uri_(std::move(uri)) {
    ::openni::OpenNI::addDeviceDisconnectedListener(this);
    ::openni::OpenNI::addDeviceStateChangedListener(this);
  }
  ~DeviceWatch() {
    ::openni::OpenNI::removeDeviceDisconnectedListener(this);
    ::openni::OpenNI::removeDeviceStateChangedListener(this);
  }
  bool gone() const { return gone_.load(std::memory_order_relaxed); }

  void onDeviceDisconnected(const ::openni::DeviceInfo* device) override {
    if (uri_ == device->getUri()) gone_.store(true, std::memory_order_relaxed);
  }
  void onDeviceStateChanged(const ::openni::DeviceInfo* device, ::openni::DeviceState state) override {
    if (uri_ == device->getUri() && state == ::openni::DEVICE_STATE_ERROR)
      gone_.store(true, std::memory_order_relaxed);
  }

 private:
  const std::string uri_;
  std::atomic<bool> gone_{false};
};

/// Images of a camera that are done with. The library uses the heap when it gets one back; it gets them on
/// its own thread, with the next image.
class UsedImages final : public VideoStream::NewFrameListener {
 public:
  void add(VideoFrameRef& image) {
    const std::lock_guard held(mutex_);
    const auto room = std::find_if(used_.begin(), used_.end(), [](auto& used) { return !used.isValid(); });
    if (room != used_.end()) *room = image;
    image.release();
  }
  void onNewFrame(VideoStream&) override {
    const std::lock_guard held(mutex_);
    for (VideoFrameRef& used : used_) used.release();
  }

 private:
  std::mutex mutex_;
  std::array<VideoFrameRef, 2 * (Pairing::kPending + 1)> used_;  ///< all that can be held
};

const char* name_of(Pairing::Kind kind) {
  return kind == Pairing::kDepth ? "depth" : "colour";
}

std::string to_text(const VideoMode& mode) {
  return std::to_string(mode.getResolutionX()) + "x" + std::to_string(mode.getResolutionY()) + " at " +
         std::to_string(mode.getFps()) + " Hz";
}

bool usable_format(Pairing::Kind kind, ::openni::PixelFormat format) {
  if (kind == Pairing::kColour) return format == ::openni::PIXEL_FORMAT_RGB888;
  return format == ::openni::PIXEL_FORMAT_DEPTH_1_MM || format == ::openni::PIXEL_FORMAT_DEPTH_100_UM;
}

int bytes_of_pixel(Pairing::Kind kind) {
  return kind == Pairing::kDepth ? static_cast<int>(sizeof(uint16_t)) : static_cast<int>(sizeof(Rgb8));
}

/// Sizes and rates of the format that we take.
std::string supported_modes(VideoStream& stream, Pairing::Kind kind) {
  const auto& modes = stream.getSensorInfo().getSupportedVideoModes();
  std::string text;
  for (int i = 0; i < modes.getSize(); ++i)
    if (usable_format(kind, modes[i].getPixelFormat()))
      text += (text.empty() ? "" : ", ") + to_text(modes[i]);
  return text.empty() ? "none" : text;
}

/// The focal length of which a field of view of `rad` shows `pixels`; 0 where that makes no sense.
float focal_px(float rad, int pixels) {
  constexpr float kLeast = 0.1f, kMost = 3.0f;
  if (!(rad > kLeast && rad < kMost)) return 0;
  return static_cast<float>(0.5 * pixels / std::tan(0.5 * static_cast<double>(rad)));
}

int64_t ns_of(const VideoFrameRef& image) {
  constexpr uint64_t kMostUs = INT64_MAX / 4000;  // leaves room for differences
  return static_cast<int64_t>(std::min<uint64_t>(image.getTimestamp(), kMostUs)) * 1000;
}

template <class T>
void copy_rows(const VideoFrameRef& image, ImageView<T> out) {
  const auto* from = static_cast<const uint8_t*>(image.getData());
  const auto stride = static_cast<size_t>(image.getStrideInBytes());
  const size_t row_bytes = static_cast<size_t>(out.cols) * sizeof(T);
  for (int32_t row = 0; row < out.rows; ++row, from += stride)
    std::memcpy(static_cast<void*>(out.row(row)), from, row_bytes);
}

}  // namespace

struct RgbdDevice::State {
  State(std::string device_uri, Kind device_kind, const CameraOptions& camera_options)
      : uri(std::move(device_uri)),
        kind(device_kind),
        options(camera_options),
        watch(uri),
        pairing(std::llround(camera_options.max_pair_ms * 1e6)),
        colour_offset_ns(std::llround(camera_options.time_offset_ms * 1e6)) {
    error.reserve(kErrorBytes);
  }
  ~State() { close(); }

  std::string open();
  std::string open_device();
  std::string create(Pairing::Kind of);
  std::string choose_mode(Pairing::Kind of);
  std::string prepare_player();
  std::string start();
  std::string register_depth();
  void set_exposure();
  void set_sync();
  void find_camera_model();
  void close();

  Read read(int32_t timeout_ms);
  Read take(Pairing::Kind of, VideoFrameRef& image, int64_t arrived_ns);
  Read end();
  void give_back(VideoFrameRef& image) { kind == Kind::camera ? used.add(image) : image.release(); }
  void count_missed(int index);
  bool unusable(Pairing::Kind of, const VideoFrameRef& image);
  [[gnu::format(printf, 2, 3)]] void say(const char* format, ...);

  VideoStream& stream(Pairing::Kind of) { return of == Pairing::kDepth ? depth : colour; }
  bool all_read() const { return kind == Kind::recording && read_of[0] >= held[0] && read_of[1] >= held[1]; }

  const std::string uri;
  const Kind kind;
  const CameraOptions options;
  DeviceWatch watch;
  ::openni::Device device;
  VideoStream depth, colour;
  UsedImages used;
  bool listens = false;  ///< `used`
  int cols = 0, rows = 0;
  CameraModel camera;
  float units_per_m = 1000;
  std::string serial;

  Pairing pairing;
  const int64_t colour_offset_ns;
  Pairing::Pair pair;  ///< holds images while it stands ready
  bool pair_ready = false;
  Stamps stamps;
  int64_t depth_arrived_ns = 0;
  uint32_t unpaired_said = 0;  ///< depth images
  bool paired_once = false;
  bool comes[2] = {false, false};                 ///< since the last pair
  int64_t held[2] = {0, 0}, read_of[2] = {0, 0};  ///< images of a recording
  bool ended = false;
  int last_index[2] = {-1, -1};
  uint32_t missed = 0;
  std::string error;
};

// Opening. Each step answers with what went wrong, or nothing.

std::string RgbdDevice::State::open() {
  if (std::string wrong = open_device(); !wrong.empty()) return wrong;
  for (const auto of : {Pairing::kDepth, Pairing::kColour})
    if (std::string wrong = create(of); !wrong.empty()) return wrong;
  if (std::string wrong = kind == Kind::recording ? prepare_player() : std::string(); !wrong.empty())
    return wrong;
  find_camera_model();
  return start();
}

std::string RgbdDevice::State::open_device() {
  if (device.open(uri.c_str()) != ::openni::STATUS_OK)
    return "OpenNI2 cannot open it (" + library_error() + ")";
  if (device.isFile() != (kind == Kind::recording))
    return kind == Kind::camera ? "OpenNI2 opens a recording in its place: see [Device] Override in "
                                  "/etc/openni2/OpenNI.ini"
                                : "OpenNI2 opens a camera in its place: see [Device] Override in "
                                  "/etc/openni2/OpenNI.ini";
  char text[64] = {};
  int size = sizeof(text) - 1;
  if (device.getProperty(::openni::DEVICE_PROPERTY_SERIAL_NUMBER, text, &size) == ::openni::STATUS_OK)
    serial = text;
  return {};
}

std::string RgbdDevice::State::create(Pairing::Kind of) {
  const auto sensor = of == Pairing::kDepth ? ::openni::SENSOR_DEPTH : ::openni::SENSOR_COLOR;
  if (device.getSensorInfo(sensor) == nullptr)
    return std::string("there are no ") + name_of(of) + " images in it; both depth and colour are needed";
  if (stream(of).create(device, sensor) != ::openni::STATUS_OK)
    return std::string("OpenNI2 refuses the ") + name_of(of) + " stream (" + library_error() + ")";
  if (kind == Kind::camera)
    if (std::string wrong = choose_mode(of); !wrong.empty()) return wrong;
  const VideoMode mode = stream(of).getVideoMode();
  if (!usable_format(of, mode.getPixelFormat()))
    return std::string("its ") + name_of(of) + " images have OpenNI2's pixel format " +
           std::to_string(mode.getPixelFormat()) +
           "; needed are millimetres (100) or tenths of them (101) and RGB888 (200)";
  if (of == Pairing::kDepth) {
    cols = mode.getResolutionX();
    rows = mode.getResolutionY();
    units_per_m = mode.getPixelFormat() == ::openni::PIXEL_FORMAT_DEPTH_1_MM ? 1000 : 10000;
  } else if (mode.getResolutionX() != cols || mode.getResolutionY() != rows) {
    return "depth has " + std::to_string(cols) + "x" + std::to_string(rows) + " pixels and colour " +
           std::to_string(mode.getResolutionX()) + "x" + std::to_string(mode.getResolutionY()) +
           "; they must be the same";
  }
  if (cols < 1 || rows < 1) return "its images have no size";
  return {};
}

/// Size and rate that were asked for, not mirrored.
std::string RgbdDevice::State::choose_mode(Pairing::Kind of) {
  VideoMode mode;
  mode.setResolution(options.cols, options.rows);
  mode.setFps(static_cast<int>(std::lround(options.rate_hz)));
  mode.setPixelFormat(of == Pairing::kDepth ? ::openni::PIXEL_FORMAT_DEPTH_1_MM
                                            : ::openni::PIXEL_FORMAT_RGB888);
  VideoStream& stream_of = stream(of);
  const bool set = stream_of.setVideoMode(mode) == ::openni::STATUS_OK;
  const VideoMode now = stream_of.getVideoMode();
  if (!set || now.getResolutionX() != options.cols || now.getResolutionY() != options.rows ||
      now.getFps() != mode.getFps())
    return std::string("the ") + name_of(of) + " stream has no " + to_text(mode) + "; it has " +
           supported_modes(stream_of, of) + ": set source.cols, source.rows and source.rate_hz";
  stream_of.setMirroringEnabled(false);
  if (stream_of.getMirroringEnabled())
    return std::string("the ") + name_of(of) + " stream stays mirrored (" + library_error() + ")";
  return {};
}

/// One image whenever one is asked for. It is told to begin anew behind the last: so its thread waits there
/// to be asked. At an end it would run round and round, and through streams that are being destroyed.
std::string RgbdDevice::State::prepare_player() {
  constexpr float kOneByOne = -1;
  ::openni::PlaybackControl* const player = device.getPlaybackControl();
  if (player == nullptr || player->setRepeatEnabled(true) != ::openni::STATUS_OK ||
      player->setSpeed(kOneByOne) != ::openni::STATUS_OK)
    return "OpenNI2's player cannot go through it image by image (" + library_error() + ")";
  for (const auto of : {Pairing::kDepth, Pairing::kColour}) {
    held[of] = player->getNumberOfFrames(stream(of));
    if (held[of] < 1) return std::string("there are no ") + name_of(of) + " images in it";
  }
  return {};
}

std::string RgbdDevice::State::start() {
  if (kind == Kind::camera) {
    if (depth.addNewFrameListener(&used) != ::openni::STATUS_OK)
      return "OpenNI2 does not tell of images (" + library_error() + ")";
    listens = true;
  }
  for (const auto of : {Pairing::kDepth, Pairing::kColour})
    if (stream(of).start() != ::openni::STATUS_OK)
      return std::string("the ") + name_of(of) + " stream does not start (" + library_error() + ")";
  if (kind == Kind::recording) return {};
  if (std::string wrong = register_depth(); !wrong.empty()) return wrong;
  set_sync();
  set_exposure();
  return {};
}

/// Before the streams run, the device forgets it again.
std::string RgbdDevice::State::register_depth() {
  constexpr auto kMode = ::openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
  if (!device.isImageRegistrationModeSupported(kMode)) {
    warn(
        "the camera cannot bring depth into the colour image: colours and edges will be off by some "
        "centimetres");
    return {};
  }
  const auto set = device.setImageRegistrationMode(kMode);
  if (set == ::openni::STATUS_OK && device.getImageRegistrationMode() == kMode) return {};
  return "the camera refuses to bring depth into the colour image (" +
         (set == ::openni::STATUS_OK ? std::string("it says yes and does not do it") : library_error()) +
         "); unplug it, plug it in and try again";
}

void RgbdDevice::State::set_sync() {
  if (device.setDepthColorSyncEnabled(true) == ::openni::STATUS_OK) return;
  device.setDepthColorSyncEnabled(false);
  warn("the camera cannot take depth and colour at the same time: they are paired by their stamps alone");
}

void RgbdDevice::State::set_exposure() {
  ::openni::CameraSettings* const settings = colour.getCameraSettings();
  const bool set = settings != nullptr &&
                   settings->setAutoExposureEnabled(options.auto_exposure) == ::openni::STATUS_OK &&
                   settings->setAutoWhiteBalanceEnabled(options.auto_white_balance) == ::openni::STATUS_OK;
  if (!set)
    warn(
        "the camera does not let exposure and white balance be set (camera.auto_exposure, "
        "camera.auto_white_balance)");
}

void RgbdDevice::State::find_camera_model() {
  const auto middle = [](int pixels) { return 0.5f * static_cast<float>(pixels - 1); };
  camera.k = {focal_px(colour.getHorizontalFieldOfView(), cols),
              focal_px(colour.getVerticalFieldOfView(), rows),
              middle(cols),
              middle(rows),
              cols,
              rows};
  if (camera.k.fx <= 0 || camera.k.fy <= 0) {
    constexpr float kXtionFocal = 525.0f / 640.0f;  // of the width
    camera.k.fx = camera.k.fy = kXtionFocal * static_cast<float>(cols);
  }
  if (options.camera) {
    camera = *options.camera;
    camera.k.width = cols;
    camera.k.height = rows;
  }
  if (options.depth_units_per_m > 0) units_per_m = options.depth_units_per_m;
}

void RgbdDevice::State::close() {
  pair = {};
  pairing.clear([](auto, VideoFrameRef&) {});
  for (VideoStream* each : {&depth, &colour})
    if (each->isValid()) each->stop();
  if (listens) depth.removeNewFrameListener(&used);
  used.onNewFrame(depth);
  for (VideoStream* each : {&depth, &colour})
    if (each->isValid()) each->destroy();
  if (device.isValid()) device.close();
}

// Reading.

RgbdDevice::Read RgbdDevice::State::read(int32_t timeout_ms) {
  if (const uint32_t unpaired = pairing.unpaired(Pairing::kDepth); unpaired_said != unpaired) {
    ++unpaired_said;
    say("a depth image has no colour image within %.3g ms", options.max_pair_ms);
    return paired_once || kind == Kind::recording ? Read::unpaired : Read::single;
  }
  if (pair_ready) return Read::pair;
  if (ended) return Read::end;
  if (all_read()) return end();
  if (watch.gone()) return Read::gone;
  VideoStream* streams[] = {&depth, &colour};
  int ready = -1;
  const auto waited = ::openni::OpenNI::waitForAnyStream(streams, 2, &ready, timeout_ms);
  if (waited == ::openni::STATUS_TIME_OUT) return Read::nothing;
  if (waited != ::openni::STATUS_OK || ready < 0 || ready > 1) return Read::gone;
  VideoFrameRef image;
  if (streams[ready]->readFrame(&image) != ::openni::STATUS_OK || !image.isValid()) return Read::gone;
  return take(ready == 0 ? Pairing::kDepth : Pairing::kColour, image, monotonic_ns());
}

/// What still waits has no partner.
RgbdDevice::Read RgbdDevice::State::end() {
  ended = true;
  pairing.clear([](auto, VideoFrameRef&) {});
  return read(0);
}

RgbdDevice::Read RgbdDevice::State::take(Pairing::Kind of, VideoFrameRef& image, int64_t arrived_ns) {
  const int index = image.getFrameIndex();
  if (kind == Kind::recording && index <= last_index[of]) return end();  // the player began anew
  comes[of] = true;
  ++read_of[of];
  if (of == Pairing::kDepth) count_missed(index);
  last_index[of] = index;
  if (unusable(of, image)) return Read::bad;
  if (of == Pairing::kDepth) depth_arrived_ns = arrived_ns;
  const int64_t stamp_ns = ns_of(image) + (of == Pairing::kColour ? colour_offset_ns : 0);
  pair_ready =
      pairing.add(of, stamp_ns, image, pair, [this](auto, VideoFrameRef& alone) { give_back(alone); });
  image.release();
  if (!pair_ready) return Read::single;
  stamps = {pair.depth.stamp_ns, pair.colour.stamp_ns, depth_arrived_ns};
  if (!paired_once && kind == Kind::camera) unpaired_said = pairing.unpaired(Pairing::kDepth);
  paired_once = true;  // until then one stream ran without the other
  comes[0] = comes[1] = false;
  return pairing.unpaired(Pairing::kDepth) == unpaired_said ? Read::pair : read(0);
}

void RgbdDevice::State::count_missed(int index) {
  const int last = last_index[Pairing::kDepth];
  const int64_t gap = last < 0 ? 0 : int64_t{index} - last - 1;
  if (gap > 0 && gap <= kMostMissed) missed += static_cast<uint32_t>(gap);
}

bool RgbdDevice::State::unusable(Pairing::Kind of, const VideoFrameRef& image) {
  const int row_bytes = cols * bytes_of_pixel(of);
  if (image.getWidth() != cols || image.getHeight() != rows) {
    say("a %s image has %dx%d pixels, expected %dx%d", name_of(of), image.getWidth(), image.getHeight(), cols,
        rows);
    return true;
  }
  if (!usable_format(of, image.getVideoMode().getPixelFormat())) {
    say("a %s image has the pixel format %d", name_of(of), image.getVideoMode().getPixelFormat());
    return true;
  }
  const int64_t needed = static_cast<int64_t>(image.getStrideInBytes()) * (rows - 1) + row_bytes;
  if (image.getData() == nullptr || image.getStrideInBytes() < row_bytes || image.getDataSize() < needed) {
    say("a %s image has %d bytes, expected %lld", name_of(of), image.getDataSize(),
        static_cast<long long>(std::max<int64_t>(needed, static_cast<int64_t>(row_bytes) * rows)));
    return true;
  }
  return false;
}

/// Into memory that is there.
void RgbdDevice::State::say(const char* format, ...) {
  char text[kErrorBytes];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  error.assign(text);
}

RgbdDevice::RgbdDevice(std::unique_ptr<State> state) : state_(std::move(state)) {}
RgbdDevice::~RgbdDevice() = default;

Result<std::unique_ptr<RgbdDevice>> RgbdDevice::open(const std::string& uri, Kind kind,
                                                     const CameraOptions& options) {
  const StdoutAside aside;
  auto state = std::make_unique<State>(uri, kind, options);
  if (std::string wrong = state->open(); !wrong.empty()) return cannot_open(std::move(wrong));
  return std::unique_ptr<RgbdDevice>(new RgbdDevice(std::move(state)));
}

const CameraModel& RgbdDevice::camera() const {
  return state_->camera;
}
float RgbdDevice::depth_units_per_m() const {
  return state_->units_per_m;
}
int64_t RgbdDevice::frames() const {
  return state_->kind == Kind::camera ? -1 : std::min(state_->held[0], state_->held[1]);
}
const std::string& RgbdDevice::serial() const {
  return state_->serial;
}

RgbdDevice::Read RgbdDevice::read(int32_t timeout_ms) {
  return state_->read(timeout_ms);
}
const RgbdDevice::Stamps& RgbdDevice::stamps() const {
  return state_->stamps;
}

void RgbdDevice::copy_to(RgbdFrame& frame) {
  copy_rows(state_->pair.depth.image, frame.depth_raw);
  copy_rows(state_->pair.colour.image, frame.colour);
  drop();
}

void RgbdDevice::drop() {
  state_->give_back(state_->pair.depth.image);
  state_->give_back(state_->pair.colour.image);
  state_->pair_ready = false;
}

uint32_t RgbdDevice::missed() const {
  return state_->missed;
}
bool RgbdDevice::depth_comes() const {
  return state_->comes[Pairing::kDepth];
}
bool RgbdDevice::colour_comes() const {
  return state_->comes[Pairing::kColour];
}
const std::string& RgbdDevice::error() const {
  return state_->error;
}

Result<std::string> find_camera(const std::string& serial) {
  const auto cameras = openni2_cameras();
  if (!cameras) return Error{cameras.error(), cameras.error_kind()};
  const StdoutAside aside;
  std::string seen;
  for (const OpenNi2Camera& camera : *cameras) {
    if (serial.empty()) return camera.uri;
    ::openni::Device device;
    char text[64] = {};
    int size = sizeof(text) - 1;
    const bool known =
        device.open(camera.uri.c_str()) == ::openni::STATUS_OK &&
        device.getProperty(::openni::DEVICE_PROPERTY_SERIAL_NUMBER, text, &size) == ::openni::STATUS_OK;
    if (known && serial == text) return camera.uri;
    seen += (seen.empty() ? "" : ", ") + camera.name + (known ? std::string(" ") + text : " (does not open)");
  }
  return cannot_open(seen.empty() ? "OpenNI2 sees no camera" : "OpenNI2 sees others only: " + seen);
}

}  // namespace stillmap::openni2
