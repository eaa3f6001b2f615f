#pragma once

#include <cstdint>

#include "kernels/base/view.hpp"

namespace stillmap {

struct RunItem;
struct Notice;
struct RgbdFrame;
struct RangeReading;

/// Keeps what a run finds out: files.  @thread record
class RunRecorder {
 public:
  virtual ~RunRecorder() = default;

  /// @param frame null: its images were not kept  @param mask of the frame (255: dynamic); no data where it
  /// was not kept
  virtual void add(const RunItem& item, const RgbdFrame* frame, ImageView<const uint8_t> mask) = 0;
  virtual void add(const Notice& notice) = 0;
  /// Of the sonar.
  virtual void add(const RangeReading& reading) = 0;
  /// Nothing came for a while; and after everything that came at once.
  virtual void idle() = 0;
};

}  // namespace stillmap
