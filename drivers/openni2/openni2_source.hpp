#pragma once

// `xtion[:SERIAL]` and `oni:FILE`: cameras of the Asus Xtion's kind and recordings of them, through OpenNI2.

#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/camera/camera_options.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Opens a camera: depth in millimetres and RGB of the size and rate asked for, depth registered to colour,
/// both taken at the same time where the device can, not mirrored. Stamps are CLOCK_MONOTONIC and rise, also
/// over `reopen`. Of `next`:
///   bad_data     a depth image without a colour image, an image of another size, a device's clock that was
///                set (the frame by which it showed is passed over)
///   unavailable  unplugged, or no pair came while `gone_s` was waited; `reopen` looks for the same serial
/// What the device calls impossible (registration, sync, exposure) is said on stderr, what it refuses though
/// it calls it possible is an error.
/// @param serial empty: the first camera that there is
/// @return kind cannot_open: not there, not permitted, no such size and rate   @thread boot
Result<std::unique_ptr<FrameSource>> open_xtion(const std::string& serial, const CameraOptions& options);

/// Opens a recording (.oni) and plays it with the library's own player, frame by frame, none left out; the
/// stamps are those of the recording. cols, rows, rate_hz, auto_* and gone_s of the options do not matter.
/// @return kind cannot_open: not there, damaged, cut off, without depth or colour   @thread boot
Result<std::unique_ptr<FrameSource>> open_oni(const std::string& path, const CameraOptions& options);

/// A camera that OpenNI2 finds, whether or not it can be opened.
struct OpenNi2Camera {
  std::string name;  ///< vendor and model
  std::string uri;
  uint16_t usb_vendor = 0, usb_product = 0;
};

/// @return an error where the library cannot be started   @thread boot
Result<std::vector<OpenNi2Camera>> openni2_cameras();

}  // namespace stillmap
