#pragma once

// What leaves and enters a running program, as plain data: CONTRACT's messages in the field's units. How they
// look on the wire is for a MessageCodec (drivers/lcm) to know.

#include <array>
#include <cstdint>
#include <string_view>

#include "kernels/base/view.hpp"
#include "runtime/core/fault.hpp"
#include "runtime/ports/frame_source.hpp"
#include "runtime/ports/odometry.hpp"

namespace stillmap {

/// Microseconds UTC.
struct Utime {
  int64_t us = 0;
  friend auto operator<=>(const Utime&, const Utime&) = default;
};

/// Where the body (x forward, y left, z up) is in local (z up), at the capture of the depth image.
/// Wire: pose_t, the members of bot_core.pose_t in their order.
struct PoseMessage {
  Utime utime;
  double pos_m[3] = {};
  double vel_m_s[3] = {};  ///< in local
  double orientation_wxyz[4] = {1, 0, 0, 0};
  double rotation_rate_rad_s[3] = {};  ///< in the body
  double accel_m_s2[3] = {};           ///< not measured: NaN
};

/// What the program is doing as a whole.
enum class Mode : uint8_t { boot, ready, running, degraded, lost, safe_stop };

/// What is left out while frames come late (DESIGN section 6), each step on top of the one before.
enum class Shed : uint8_t { nothing, every_second_integration, finest_level };

/// The answer to a command.
enum class CommandResult : uint8_t { none, accepted, done, failed, refused };

/// Every frame. Wire: status_t.
struct StatusMessage {
  Utime utime;         ///< capture of the depth image; while there is no frame: now
  uint32_t frame = 0;  ///< counts what the source delivered
  Mode mode = Mode::boot;
  uint8_t state = 2;  ///< TrackingState: 0 good, 1 poor, 2 lost
  Shed shed = Shed::nothing;
  float covariance[21] = {};  ///< upper triangle, x y z rx ry rz, left perturbation in local
  float p_good = 0;
  float inlier_ratio = 0;
  float masked_fraction = 0;
  float prepare_ms = 0, track_ms = 0, mask_ms = 0, refine_ms = 0, integrate_ms = 0, total_ms = 0;
  float pose_age_ms = 0;  ///< capture to handing the pose to the socket; 0 where none left
  float rate_hz = 0;      ///< processed frames a second, of late
  float map_fill = 0;     ///< of the fullest pool, 0..1
  uint32_t map_blocks = 0;
  uint32_t frames_dropped = 0;   ///< by capture: a newer one was there
  uint32_t results_dropped = 0;  ///< by the queues to publish and record
  uint32_t deadline_misses = 0;
  uint64_t faults_latched = 0;  ///< bit n: Fault n was raised since the start
  uint64_t faults_active = 0;   ///< bit n: it holds now
  uint32_t fault_count[kFaults] = {};
  uint32_t pose_epoch = 0;  ///< counts every discontinuity: relocalisation, reset, new map
  uint64_t map_id = 0;      ///< of the map that the poses are in
  uint32_t command_id = 0;  ///< the last command
  CommandResult command_result = CommandResult::none;
};

/// One reading of the near-range sonar. Wire: range_t.
struct RangeMessage {
  Utime utime;
  float range_m = 0;  ///< 0: no echo
  float max_range_m = 0;
  bool valid = false;
  bool stop = false;  ///< nearer than sonar.stop_m
};

enum class Command : uint8_t { save_map = 1, save_mesh = 2, reset = 3, stop = 4 };

/// From a planner or an operator. Wire: command_t.
struct CommandMessage {
  Utime utime;
  uint32_t id = 0;
  Command command = Command::stop;
  std::array<char, 64> file = {};  ///< of save_*: a name inside --out, ended by 0; empty: the usual name
};

/// How a frame's images are kept in the log.
enum class ImageCoding : uint8_t { none, zstd_depth, zstd_colour, jpeg };

/// A frame as it was used. Wire: frame_t (longer than a datagram: log only).
struct FrameMessage {
  Utime utime;
  Stamp depth_stamp, colour_stamp;  ///< of the source's clock
  uint32_t sequence = 0;
  ImageCoding depth_coding = ImageCoding::none, colour_coding = ImageCoding::none;
  View<const uint8_t> depth, colour;  ///< coded
  uint32_t crc32c = 0;                ///< checksum_of (runtime/record/frame_coder.hpp)
};

/// What the odometry said to the pipeline.
struct OdometryAnswer {
  Stamp asked;  ///< clock of the odometry, as that of the sample
  OdometrySample sample;
};
/// In one frame: where the body was at the last frame, and at this one.
inline constexpr uint32_t kOdometryAnswers = 2;

/// What a live run decided about a frame: with the frames it makes the run repeatable. Wire: decision_t.
struct DecisionMessage {
  Utime utime;
  uint32_t sequence = 0;
  bool used = false;  ///< false: dropped, a newer one was there
  Shed shed = Shed::nothing;
  bool integrated = true;        ///< false: integration was shed
  bool new_map = false;          ///< the map was given up before this frame
  uint32_t archive_answers = 0;  ///< that BlockArchive::step took after this frame
  uint32_t odometry_answers = 0;
  OdometryAnswer odometry[kOdometryAnswers];
  float sonar_m = 0;  ///< that it was told (FrameWork::sonar_m)
};

/// What a log begins with: all that reading its frames needs. Wire: session_t.
struct SessionMessage {
  Utime utime;
  std::string_view version, source,
      config_toml;  ///< the program's, SourceInfo::name, the whole configuration
  int32_t width = 0, height = 0;
  double k[4] = {};           ///< fx fy cx cy, pixels
  double distortion[5] = {};  ///< k1 k2 p1 p2 k3
  double depth_units_per_m = 0;
  Se3d T_map_cam;        ///< pose of the first frame, or where the camera is looked for first in `map`
  std::string_view map;  ///< the file that the run went on with; empty: none
  double depth_bias[4] = {0, 1, 0, 0};  ///< DepthBias::c
};

inline constexpr uint32_t kEventNameBytes = 64, kEventTextBytes = 1000;

/// One line of events.log. Wire: event_t.
struct EventMessage {
  Utime utime;
  bool fault = false;
  std::string_view name, text;  ///< at most 64 and 1000 bytes; what is longer is cut
};

}  // namespace stillmap
