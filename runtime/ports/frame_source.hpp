#pragma once

// What a camera or a recording looks like to the runtime; drivers implement it.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/base/status.hpp"
#include "kernels/base/view.hpp"

namespace stillmap {

/// Nanoseconds; of the source's own clock for recordings.
struct Stamp {
  int64_t ns = 0;

  double seconds() const { return static_cast<double>(ns) * 1e-9; }
  friend auto operator<=>(const Stamp&, const Stamp&) = default;
};

/// Of RgbdFrame::truth_mask.
inline constexpr uint8_t kTrulyDynamic = 255;
inline constexpr uint8_t kPutDown = 1;  ///< stands still, but for less than a second: nobody can know yet

/// Memory of one frame, allocated by its owner with the size of SourceInfo; a source fills it.
struct RgbdFrame {
  Stamp depth_stamp;  ///< capture of the depth image
  Stamp colour_stamp;
  Stamp captured;  ///< the depth image's, as CLOCK_MONOTONIC; 0: a recording that is read as fast as it goes
  uint32_t sequence = 0;          ///< index in the source, skipped and bad frames counted
  ImageView<uint16_t> depth_raw;  ///< 0 and 65535: invalid
  ImageView<Rgb8> colour;
  ImageView<uint8_t> truth_mask;  ///< kTrulyDynamic, kPutDown or 0; only when SourceInfo::has_truth_mask,
                                  ///< else no data
  std::optional<Se3d> truth_T_world_cam;  ///< source's world; only where the source knows it
  float sonar_m = 0;  ///< a valid reading of the near range that comes with the frame; 0: none
};

struct SourceInfo {
  std::string name;  ///< as given, for reports: "tum:DIR"
  CameraModel camera;
  float depth_units_per_m = 5000;
  DepthBias depth_bias = {};                     ///< of the raw depth
  std::optional<DepthCamera> depth_camera = {};  ///< of depth that is still to be registered to colour; none:
                                                 ///< it is
  uint64_t registration_bytes = 0;               ///< of registering it, taken when the source was opened
  int64_t frames = -1;                           ///< number of frames, -1: unknown (live)
  bool has_truth_mask = false;
};

class OdometryPort;

/// @thread open: boot; next: one reader thread
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  virtual const SourceInfo& info() const = 0;

  /// Fills `frame`, waiting at most `timeout_ms` (recordings do not wait).
  /// @return ok; end; timeout; bad_data: this frame is unusable and was passed over, `error()` says which
  /// file and why;
  ///         unavailable: the source is gone
  virtual Status next(RgbdFrame& frame, int32_t timeout_ms) = 0;

  /// As `next`, in two parts, so that a camera is read again at once: what takes long is left to `finish`,
  /// which everybody calls who looks at the depth of a frame that this filled.
  virtual Status next_unfinished(RgbdFrame& frame, int32_t timeout_ms) { return next(frame, timeout_ms); }
  /// Does not allocate.  @thread one, also while the reader thread is in `next_unfinished`
  virtual void finish(RgbdFrame& /*frame*/) {}

  /// Points of the true static surface (as it is at the end), source's world, metres; empty where unknown.
  /// @thread boot
  virtual std::vector<Vec3> truth_cloud() const { return {}; }

  /// Odometry that comes with the frames; null where there is none. Lives as long as the source.
  virtual OdometryPort* odometry() { return nullptr; }

  /// A camera: frames come at their own pace, and one that is gone may come back.
  virtual bool live() const { return false; }

  /// Closes a camera that is gone and tries to open it again, once. May allocate and take seconds.
  /// @return ok: `next` goes on, stamps still rise; unavailable: it is not there, `error()` says what to do
  /// @thread the reader thread
  virtual Status reopen() { return Status::unavailable; }

  /// Passes over `count` frames without decoding them.
  virtual void skip(uint32_t count) = 0;

  /// Frames that it left out by itself because nobody took them in time, since the start.
  virtual uint32_t left_out() const { return 0; }

  /// One line: which file, what was expected, what to do.
  virtual const std::string& error() const = 0;
};

}  // namespace stillmap
