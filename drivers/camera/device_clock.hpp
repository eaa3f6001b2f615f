#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace stillmap {

/// Stamps of a device's own clock as CLOCK_MONOTONIC. A frame arrives some time after it was taken, by an
/// unknown and changing delay that is never negative: the smallest difference of a window of time comes
/// nearest to the offset of the clocks. A line through those of the last windows (median of the slopes,
/// median of the residuals) follows the drift and is not impressed by windows in which every frame was late.
/// The part of the delay that every frame has stays in the result. Fixed memory; a window's end costs some
/// thousand operations, every other frame a few.
/// @thread map: one; the counters: any
class DeviceClock {
 public:
  static constexpr int64_t kWindowNs = 1'000'000'000;
  static constexpr int64_t kJumpNs =
      50'000'000;                               ///< farther from the estimate than any delay or drift; in
                                                ///< the first window, before which little is known, kWindowNs
  static constexpr uint32_t kLateFrames = 30;   ///< late by more than that one after the other: a jump
  static constexpr double kMostDrift = 500e-6;  ///< seconds a second; quartz is ten times better

  struct Mapped {
    int64_t monotonic_ns = 0;
    bool jumped = false;  ///< the device's clock was set; monotonic_ns is when the frame arrived
  };

  /// Results rise while the frames arrive one after the other, and are never later than the arrival.
  /// @param device_ns  of the device's clock, from wherever it starts
  /// @param arrived_ns CLOCK_MONOTONIC when the frame was seen
  Mapped map(int64_t device_ns, int64_t arrived_ns);

  /// Begins anew, as for a device that was opened again. Results go on rising; not counted as a jump.
  void restart() { started_ = false; }

  uint32_t jumps() const { return jumps_.load(std::memory_order_relaxed); }
  /// Of the device's clock against CLOCK_MONOTONIC, seconds a second; 0 until three windows are over.
  double drift() const { return drift_.load(std::memory_order_relaxed); }

 private:
  static constexpr uint32_t kWindows = 32;

  /// The frame of a window that came with the least delay.
  struct Least {
    int64_t device_ns = 0;
    int64_t offset_ns = 0;  ///< arrived - device
  };

  void start(Least sample);
  bool jumped(int64_t device_ns, int64_t residual_ns);
  void add(Least sample);
  void fit_line();
  int64_t offset_at(int64_t device_ns) const;

  bool started_ = false;
  int64_t last_device_ns_ = 0, last_mapped_ns_ = INT64_MIN;
  uint32_t late_frames_ = 0;

  int64_t window_start_ns_ = 0;
  Least least_;  ///< of the window that is not over
  std::array<Least, kWindows> windows_;
  uint32_t windows_over_ = 0;  ///< since it started; windows_ holds the last of them

  Least line_;  ///< a point of the line
  std::atomic<double> drift_{0};
  std::atomic<uint32_t> jumps_{0};
};

}  // namespace stillmap
