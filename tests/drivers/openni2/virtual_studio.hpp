#pragma once

// Makes what the virtual camera sends, and recordings of it by the library's own recorder.

#include <OpenNI.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "drivers/synthetic/synthetic_source.hpp"
#include "tests/drivers/openni2/virtual_camera.hpp"
#include "tests/support/frame_memory.hpp"

namespace stillmap::virtual_camera {

/// Renders a synthetic scene into a file of images. Depth in millimetres; `raw`: as the scene has it, in
/// 1/5000 of a metre, which loses nothing.
/// @return what went wrong; empty: done
inline std::string render(const std::string& scene, const std::string& path, int frames, bool raw) {
  auto source = open_synthetic(scene);
  if (!source) return source.error();
  const Intrinsics& k = (*source)->info().camera.k;
  const auto fov = [](int32_t pixels, float focal) {
    return 2 * std::atan(0.5f * static_cast<float>(pixels) / focal);
  };
  const FramesHeader header = {k.width, k.height, frames, fov(k.width, k.fx), fov(k.height, k.fy)};
  std::ofstream out(path, std::ios::binary);
  out.write(reinterpret_cast<const char*>(&header), sizeof header);
  test::FrameMemory memory((*source)->info());
  const float mm = 1000 / (*source)->info().depth_units_per_m;
  for (int i = 0; i < frames; ++i) {
    if ((*source)->next(memory.frame, 0) != Status::ok) return scene + " has fewer frames";
    if (!raw)
      for (uint16_t& depth : memory.depth)
        depth = static_cast<uint16_t>(std::lround(mm * static_cast<float>(depth)));
    out.write(reinterpret_cast<const char*>(memory.depth.data()),
              static_cast<std::streamsize>(memory.depth.size() * sizeof(uint16_t)));
    out.write(reinterpret_cast<const char*>(memory.colour.data()),
              static_cast<std::streamsize>(memory.colour.size() * sizeof(Rgb8)));
  }
  return out.flush() ? std::string() : path + ": cannot be written";
}

/// Opens the camera; recordings that were opened before are in the library's list as well.
inline bool open_camera(::openni::Device& device) {
  ::openni::Array<::openni::DeviceInfo> all;
  ::openni::OpenNI::enumerateDevices(&all);
  for (int i = 0; i < all.getSize(); ++i)
    if (all[i].getUsbVendorId() != 0) return device.open(all[i].getUri()) == ::openni::STATUS_OK;
  return false;
}

inline constexpr int kLeastDepthBytes = 100;

/// Of one image, which the recorder does not compress.
inline int colour_bytes(const ::openni::VideoStream& colour) {
  const ::openni::VideoMode mode = colour.getVideoMode();
  return mode.getResolutionX() * mode.getResolutionY() * static_cast<int>(sizeof(Rgb8));
}

/// The recorder starts in a thread of its own and drops what comes before it did. It has when the file ends
/// with two records for each stream: that it is ready, and that its data begin.
inline bool recorder_runs(const std::string& path, int streams) {
  constexpr std::streamoff kReadyBytes = 28, kDataBeginBytes = 40;
  constexpr uint32_t kDataBegin = 8;
  std::ifstream file(path, std::ios::binary);
  for (int i = 0; i < streams; ++i) {
    uint32_t magic_and_type[2] = {};
    if (!file.seekg(-kDataBeginBytes - i * (kReadyBytes + kDataBeginBytes), std::ios::end) ||
        !file.read(reinterpret_cast<char*>(magic_and_type), sizeof magic_and_type) ||
        magic_and_type[1] != kDataBegin)
      return false;
  }
  return true;
}

/// Records what the camera sends, each image once and without loss.
/// @param only_depth a recording without colour
inline std::string record(Control& control, const std::string& path, int frames, bool only_depth = false) {
  namespace oni = ::openni;
  const auto wrong = [](const char* what) {
    return std::string(what) + ": " + oni::OpenNI::getExtendedError();
  };
  if (oni::OpenNI::initialize() != oni::STATUS_OK) return wrong("initialize");
  std::string problem;
  {
    oni::Device device;
    oni::VideoStream depth, colour;
    oni::Recorder recorder;
    control.hold = control.unpaced = control.plugged = 1;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!open_camera(device) && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    if (!device.isValid() || depth.create(device, oni::SENSOR_DEPTH) != oni::STATUS_OK ||
        colour.create(device, oni::SENSOR_COLOR) != oni::STATUS_OK ||
        recorder.create(path.c_str()) != oni::STATUS_OK || recorder.attach(depth, false) != oni::STATUS_OK ||
        (!only_depth && recorder.attach(colour, false) != oni::STATUS_OK) ||
        depth.start() != oni::STATUS_OK || colour.start() != oni::STATUS_OK ||
        recorder.start() != oni::STATUS_OK)
      problem = wrong("recorder");
    const auto wait = [&](const char* what, auto done) {
      while (problem.empty() && !done()) {
        if (std::chrono::steady_clock::now() > end) problem = what;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
    };
    wait("the recorder does not start", [&] { return recorder_runs(path, only_depth ? 1 : 2); });
    control.hold = 0;
    const uintmax_t whole = static_cast<uintmax_t>(frames) *
                            static_cast<uintmax_t>(only_depth ? kLeastDepthBytes : colour_bytes(colour));
    wait("not everything was recorded", [&] {
      std::error_code error;
      return control.sent >= frames && std::filesystem::file_size(path, error) >= whole;
    });
    depth.stop();
    colour.stop();
    recorder.stop();
    recorder.destroy();
    depth.destroy();
    colour.destroy();
    device.close();
    control.unpaced = 0;
  }
  oni::OpenNI::shutdown();
  return problem;
}

}  // namespace stillmap::virtual_camera
