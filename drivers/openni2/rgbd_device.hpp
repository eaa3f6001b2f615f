#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "config/result.hpp"
#include "drivers/camera/camera_options.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap::openni2 {

/// Depth and colour stream of a camera or of a recording, started, and their images in pairs.
/// @thread open, destructor: boot or the reader; the rest: the reader
class RgbdDevice {
 public:
  enum class Kind : uint8_t { camera, recording };
  enum class Read : uint8_t {
    pair,      ///< stands ready for `copy_to` or `drop`
    single,    ///< an image that waits for its partner
    unpaired,  ///< a depth image was given up
    bad,       ///< an image cannot be used, `error` says why
    nothing,   ///< came within the time
    end,       ///< of the recording
    gone
  };
  /// Of a pair, the device's clock; colour with the time offset of the options.
  struct Stamps {
    int64_t depth_ns = 0, colour_ns = 0;
    int64_t arrived_ns = 0;  ///< CLOCK_MONOTONIC, when the depth image was there
  };

  /// @param uri what the library calls the camera, or the path of a recording
  /// @return kind cannot_open; the text says neither which source it is nor which device
  static Result<std::unique_ptr<RgbdDevice>> open(const std::string& uri, Kind kind,
                                                  const CameraOptions& options);
  ~RgbdDevice();
  RgbdDevice(const RgbdDevice&) = delete;
  RgbdDevice& operator=(const RgbdDevice&) = delete;

  /// Pinhole of the colour image, from its field of view.
  const CameraModel& camera() const;
  float depth_units_per_m() const;
  /// Of a recording; -1 for a camera.
  int64_t frames() const;
  /// Empty where the device has none.
  const std::string& serial() const;

  /// Waits for one image; a pair that was not taken is given up. Does not allocate.
  Read read(int32_t timeout_ms);
  const Stamps& stamps() const;
  /// Copies the pair that stands ready: the only copy on the way from the library to the pipeline.
  /// @param frame of the camera's size
  void copy_to(RgbdFrame& frame);
  void drop();

  /// Depth images that came and went before they were read, by the device's own numbers.
  uint32_t missed() const;
  /// Whether images of the kind came since the last pair.
  bool depth_comes() const;
  bool colour_comes() const;
  const std::string& error() const;

 private:
  struct State;
  explicit RgbdDevice(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

/// The camera with this serial number, or the first one.
/// @return what the library calls it; kind cannot_open, and the text says neither which source it is
Result<std::string> find_camera(const std::string& serial);

}  // namespace stillmap::openni2
