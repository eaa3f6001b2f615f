#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include "drivers/camera/frame_pairing.hpp"
#include "kernels/base/view.hpp"
#include "runtime/core/bounded_queue.hpp"

namespace stillmap {

/// Decodes the JPEG images of a camera on a thread of its own, one after the other, into memory that is taken
/// when it is made. At most kAtOnce are on their way; more are refused.
/// @thread made, destructor: boot or the reader thread; the others: the reader thread
class MjpegDecoder {
 public:
  static constexpr uint32_t kAtOnce = 2;

  struct Job {
    const uint8_t* data = nullptr;  ///< stays as it is until the image is taken
    uint32_t bytes = 0;
    uint32_t buffer = 0;  ///< the caller's, handed through
    int64_t stamp_ns = 0;
  };
  struct Decoded {
    Job job;
    uint32_t slot = 0;  ///< of the image
    bool good = false;  ///< else it is not a whole JPEG image of the size asked for
  };

  /// @param rows, cols of the images
  MjpegDecoder(int32_t rows, int32_t cols);
  /// Waits for the image that is decoded right now; what else is on its way is dropped.
  ~MjpegDecoder();
  MjpegDecoder(const MjpegDecoder&) = delete;
  MjpegDecoder& operator=(const MjpegDecoder&) = delete;

  /// @return false: kAtOnce are on their way, or the caller holds all slots
  bool submit(const Job& job);
  /// The oldest that is decoded, without waiting. Its slot is the caller's until it is released, good or not.
  bool take(Decoded& decoded);
  ImageView<const Rgb8> image(uint32_t slot) const;
  void release(uint32_t slot) { taken_[slot] = false; }
  /// Can be read while a decoded image waits; for poll. -1: the system has none to give, nothing will ever be
  /// decoded.
  int descriptor() const { return event_; }

 private:
  /// Those that wait for their partners, and those on their way.
  static constexpr uint32_t kSlots = FramePairing<int>::kPending + kAtOnce + 1;

  void work();

  const int32_t rows_, cols_;
  const int event_;
  std::vector<Rgb8> memory_;  ///< kSlots images
  std::array<bool, kSlots> taken_{};
  uint32_t on_their_way_ = 0;
  BoundedQueue<Decoded> jobs_{kAtOnce}, done_{kAtOnce};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace stillmap
