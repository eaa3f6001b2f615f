#pragma once

// What the virtual camera (a driver module of OpenNI2, virtual_device.cpp) and the programs that use it have
// in common: the file of images that it sends, and the memory by which it is told to misbehave.

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <string>

namespace stillmap::virtual_camera {

inline constexpr const char* kFramesVariable = "STILLMAP_VIRTUAL_FRAMES";    ///< path of the images
inline constexpr const char* kControlVariable = "STILLMAP_VIRTUAL_CONTROL";  ///< path of the control memory
inline constexpr const char* kSerial = "VIRTUAL0001";

/// Then follow `count` times: depth, cols x rows uint16; colour, cols x rows x 3 bytes.
struct FramesHeader {
  int32_t cols = 0, rows = 0, count = 0;
  float horizontal_fov_rad = 0, vertical_fov_rad = 0;
};

enum Registration : int32_t { kObeys = 0, kRefuses = 1, kSaysYesDoesNothing = 2, kUnsupported = 3 };

/// A file that all sides map. All zero: nothing is plugged in. Offsets of 4 bytes in this order.
struct Control {
  std::atomic<int32_t> plugged;          ///< 0: no camera
  std::atomic<int32_t> stalled;          ///< sends nothing
  std::atomic<int32_t> small_images;     ///< so many of the next depth images have half the width
  std::atomic<int32_t> no_colour;        ///< sends depth only
  std::atomic<int32_t> stamp_shift_ms;   ///< its clock was set by so much
  std::atomic<int32_t> colour_shift_ms;  ///< colour is taken so much later than depth
  std::atomic<int32_t> registration;     ///< Registration
  std::atomic<int32_t> no_sync;          ///< cannot take depth and colour at the same time
  std::atomic<int32_t> unpaced;          ///< sends as fast as it can, each image once
  std::atomic<int32_t> hold;             ///< waits with the first image
  // What it tells
  std::atomic<int32_t> sent;        ///< depth images since it was opened
  std::atomic<int32_t> registered;  ///< registration is in force
  std::atomic<int32_t> mirrored;    ///< of either stream
  std::atomic<int32_t> auto_exposure, auto_white_balance;
  std::atomic<int32_t> opened;  ///< how often
};

/// A file in memory; null where it is not there.
class Mapped {
 public:
  Mapped(const char* path, bool writable) {
    const int file = path == nullptr ? -1 : ::open(path, writable ? O_RDWR : O_RDONLY);
    struct stat about {};
    if (file < 0 || ::fstat(file, &about) != 0 || about.st_size == 0) return;
    size_ = static_cast<size_t>(about.st_size);
    void* const memory =
        ::mmap(nullptr, size_, writable ? PROT_READ | PROT_WRITE : PROT_READ, MAP_SHARED, file, 0);
    if (memory != MAP_FAILED) memory_ = memory;
    ::close(file);
  }
  ~Mapped() {
    if (memory_ != nullptr) ::munmap(memory_, size_);
  }
  Mapped(const Mapped&) = delete;
  Mapped& operator=(const Mapped&) = delete;

  void* memory() const { return memory_; }
  size_t size() const { return size_; }

 private:
  void* memory_ = nullptr;
  size_t size_ = 0;
};

/// The images of a file, as the camera sends them.
class Frames {
 public:
  explicit Frames(const char* path) : file_(path, false) {
    if (file_.size() < sizeof header_) return;
    std::memcpy(&header_, file_.memory(), sizeof header_);
    if (file_.size() < sizeof header_ + static_cast<size_t>(header_.count) * frame_bytes()) header_.count = 0;
  }
  const FramesHeader& header() const { return header_; }
  size_t pixels() const { return static_cast<size_t>(header_.cols) * static_cast<size_t>(header_.rows); }
  size_t depth_bytes() const { return pixels() * 2; }
  size_t colour_bytes() const { return pixels() * 3; }
  /// Where the camera is with its `sent`th moment: to the last image and back again, on and on.
  int image_of(int sent) const {
    const int way = header_.count - 1, there = way > 0 ? sent % (2 * way) : 0;
    return there <= way ? there : 2 * way - there;
  }
  const uint8_t* depth(int index) const {
    return static_cast<const uint8_t*>(file_.memory()) + sizeof header_ +
           static_cast<size_t>(index % header_.count) * frame_bytes();
  }
  const uint8_t* colour(int index) const { return depth(index) + depth_bytes(); }

 private:
  size_t frame_bytes() const { return depth_bytes() + colour_bytes(); }

  Mapped file_;
  FramesHeader header_;
};

}  // namespace stillmap::virtual_camera
