#pragma once

#include <array>
#include <cstdint>

#include "runtime/ports/messages.hpp"

namespace stillmap {

/// Decides what is left out while frames take longer than the camera's period (DESIGN section 6). Mean times
/// are taken over a window of frames, so that a single late frame sheds nothing; what was shed comes back
/// when the frame would fit again with room to spare, and a return that did not hold is tried again after
/// twice the time.                                                                               test:
/// load_test
/// @thread real-time; neither waits nor allocates
class LoadShedder {
 public:
  static constexpr uint32_t kWindow = 30;      ///< frames
  static constexpr double kTooMuch = 1.0;      ///< of the period, mean: more is shed
  static constexpr double kRoom = 0.85;        ///< of the period, what a return may take
  static constexpr double kFinestShare = 1.6;  ///< time with the finest level over that without, at most
  static constexpr uint32_t kPatience = 90;    ///< frames before a return
  static constexpr uint32_t kMostPatience = 5400;

  Shed shed() const { return shed_; }
  /// Of the frame that comes next.
  bool integrate() const { return shed_ == Shed::nothing || frame_ % 2 == 0; }
  int32_t finest_level() const { return shed_ == Shed::finest_level ? 1 : 0; }

  /// After a frame.
  /// @param period_ms of the camera; 0 or less: not known, nothing is decided
  void add(double total_ms, bool integrated, double period_ms);

 private:
  double mean_ms() const;
  double mean_whole_ms() const;
  void change(Shed to);

  Shed shed_ = Shed::nothing;
  uint32_t frame_ = 0, in_window_ = 0;
  std::array<float, kWindow> ms_{};
  std::array<bool, kWindow> integrated_{};
  uint32_t since_change_ = 0;
  uint32_t patience_ = kPatience;
  bool returned_ = false;  ///< the last change gave something back
};

}  // namespace stillmap
