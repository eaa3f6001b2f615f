#pragma once

// Everything that can be set, in sections as CONTRACT names them. Algorithm numbers are in
// kernels/params.hpp.

#include <array>
#include <cstdint>
#include <string>

#include "kernels/params.hpp"

namespace stillmap {

/// Overrides of what the source says about itself; 0: not overridden.
struct CameraConfig {
  float fx = 0, fy = 0, cx = 0, cy = 0;
  float k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  float depth_units_per_m = 0;
  std::string calibration;
  bool auto_exposure = true;
  bool auto_white_balance = true;

  template <class F>
  static void fields(F&& f) {
    using P = CameraConfig;
    f("fx", &P::fx, 0, 1e5, "pixels", "Eq. (1)", "0: from the source");
    f("fy", &P::fy, 0, 1e5, "pixels", "Eq. (1)", "0: from the source");
    f("cx", &P::cx, 0, 1e5, "pixels", "Eq. (1)", "0: from the source");
    f("cy", &P::cy, 0, 1e5, "pixels", "Eq. (1)", "0: from the source");
    f("k1", &P::k1, -10, 10, "1", "ours", "Brown-Conrady, used with fx");
    f("k2", &P::k2, -10, 10, "1", "ours", "Brown-Conrady, used with fx");
    f("p1", &P::p1, -1, 1, "1", "ours", "Brown-Conrady, used with fx");
    f("p2", &P::p2, -1, 1, "1", "ours", "Brown-Conrady, used with fx");
    f("k3", &P::k3, -10, 10, "1", "ours", "Brown-Conrady, used with fx");
    f("depth_units_per_m", &P::depth_units_per_m, 0, 1e6, "units/m", "ours", "0: from the source");
    f("calibration", &P::calibration, 0, 4000, "TOML file", "ours",
      "intrinsics, extrinsics, depth scale and bias; empty: what the source says; the keys above override "
      "it");
    f("auto_exposure", &P::auto_exposure, 0, 1, "bool", "ours", "cameras: of the colour image");
    f("auto_white_balance", &P::auto_white_balance, 0, 1, "bool", "ours", "cameras: of the colour image");
  }
};

struct SourceConfig {
  float wait_s = 0;
  float stall_s = 1;
  float time_offset_ms = 0;
  float max_pair_ms = 20;
  int32_t cols = 640;
  int32_t rows = 480;
  float rate_hz = 30;
  float gone_s = 5;
  float reopen_s = 0.5f;
  float reopen_max_s = 10;

  template <class F>
  static void fields(F&& f) {
    using P = SourceConfig;
    f("wait_s", &P::wait_s, -1, 1e9, "s", "ours", "how long to wait for the source to appear; -1: for ever");
    f("stall_s", &P::stall_s, 0.05, 1e6, "s", "ours",
      "live: no frame for so long is the fault camera_stalled");
    f("time_offset_ms", &P::time_offset_ms, -1e4, 1e4, "ms", "ours",
      "added to the colour stamp before pairing");
    f("max_pair_ms", &P::max_pair_ms, 0, 1000, "ms", "ours", "largest distance of the stamps of a pair");
    f("cols", &P::cols, 16, 4096, "pixels", "ours", "cameras: width that is asked for, of depth and colour");
    f("rows", &P::rows, 16, 4096, "pixels", "ours", "cameras: height that is asked for");
    f("rate_hz", &P::rate_hz, 1, 240, "Hz", "ours", "cameras: rate that is asked for");
    f("gone_s", &P::gone_s, 0.1, 1e6, "s", "ours",
      "cameras: no frame for so long, and it is closed and opened again");
    f("reopen_s", &P::reopen_s, 0.05, 1e6, "s", "ours",
      "cameras: wait before a camera that is gone is opened again; doubled with each failure");
    f("reopen_max_s", &P::reopen_max_s, 0.05, 1e6, "s", "ours", "up to this");
  }
};

/// Where the camera sits on the robot.
struct MountConfig {
  /// Body (x forward, y left, z up) from camera: place in metres, unit quaternion x y z w. A level camera
  /// that looks forward.
  std::array<float, 7> T_body_cam = {0, 0, 0, -0.5f, 0.5f, -0.5f, 0.5f};
  std::array<float, 2> initial_rp_deg = {0, 0};

  template <class F>
  static void fields(F&& f) {
    using P = MountConfig;
    f("T_body_cam", &P::T_body_cam, -100, 100, "m and quaternion x y z w", "ours",
      "pose of the camera on the body (x forward, y left, z up)");
    f("initial_rp_deg", &P::initial_rp_deg, -180, 180, "deg", "ours",
      "roll and pitch of the body when it starts: the camera cannot tell what is level");
  }
};

/// Wheel odometry or the like, used where track.prior = "odometry".
struct OdometryConfig {
  float max_age_ms = 60;
  float time_offset_ms = 0;
  float sigma_m_per_m = 0.05f;
  float sigma_rad_per_rad = 0.03f;
  float sigma_rad_per_m = 0.02f;

  template <class F>
  static void fields(F&& f) {
    using P = OdometryConfig;
    f("max_age_ms", &P::max_age_ms, 0, 1e4, "ms", "ours",
      "older odometry is stale: the motion is predicted without it");
    f("time_offset_ms", &P::time_offset_ms, -1e4, 1e4, "ms", "ours", "added to the stamps of the odometry");
    f("sigma_m_per_m", &P::sigma_m_per_m, 0, 10.0, "m/m", "ours", "its error of place, over the way gone");
    f("sigma_rad_per_rad", &P::sigma_rad_per_rad, 0, 10.0, "rad/rad", "ours",
      "its error of direction, over the turn");
    f("sigma_rad_per_m", &P::sigma_rad_per_m, 0, 10.0, "rad/m", "ours",
      "its error of direction, over the way gone");
  }
};

enum class SonarKind : uint8_t { none, hc_sr04, pulse_width };

/// A sonar on GPIO lines for what is nearer than the camera can see (paper III-E).
struct SonarConfig {
  SonarKind kind = SonarKind::none;
  std::string chip = "/dev/gpiochip0";
  int32_t trigger_line = -1;
  int32_t echo_line = -1;
  int32_t stop_line = -1;
  float rate_hz = 15;
  float temperature_c = 20;
  float pulse_us_per_m = 5800;
  float min_m = 0.02f;
  float max_m = 4.0f;
  int32_t median = 3;
  float beam_deg = 30;
  /// Camera (optical) from sonar (looks along its z): place in metres, unit quaternion x y z w.
  std::array<float, 7> T_cam_sonar = {0, -0.04f, 0, 0, 0, 0, 1};
  float veto_m = 0.5f;
  float stop_m = 0.25f;
  float max_age_s = 0.25f;
  float lost_s = 2;
  float stuck_s = 1;

  template <class F>
  static void fields(F&& f) {
    using P = SonarConfig;
    f("kind", &P::kind, 0, 2, "none|hc_sr04|pulse_width", "III-E",
      "hc_sr04: trigger and echo; pulse_width: the echo line alone says the distance (MaxBotix)");
    f("chip", &P::chip, 0, 4000, "GPIO chip", "ours", "that its lines are on");
    f("trigger_line", &P::trigger_line, -1, 1023, "line", "ours", "output, hc_sr04 only; -1: none");
    f("echo_line", &P::echo_line, -1, 1023, "line", "ours", "input, both edges are stamped by the kernel");
    f("stop_line", &P::stop_line, -1, 1023, "line", "ours",
      "output, high while something is nearer than stop_m; -1: none");
    f("rate_hz", &P::rate_hz, 0.1, 20, "Hz", "ours",
      "hc_sr04: readings a second; an older echo must have died away");
    f("temperature_c", &P::temperature_c, -40, 85, "degrees C", "ours", "of the air: the speed of sound");
    f("pulse_us_per_m", &P::pulse_us_per_m, 100, 1e5, "us/m", "ours",
      "pulse_width: MaxBotix XL 5800, LV 5787, HR 1000");
    f("min_m", &P::min_m, 0, 10, "m", "ours", "nearer readings are not believed");
    f("max_m", &P::max_m, 0.1, 20, "m", "ours", "an echo from farther away is none");
    f("median", &P::median, 1, 15, "readings", "ours", "of the last so many; 1: each is taken as it comes");
    f("beam_deg", &P::beam_deg, 1, 120, "degrees", "III-E", "full opening of its cone");
    f("T_cam_sonar", &P::T_cam_sonar, -100, 100, "m and quaternion x y z w", "III-E",
      "pose of the sonar, which looks along its z, in the optical frame of the camera");
    f("veto_m", &P::veto_m, 0, 10, "m", "III-E",
      "with a reading nearer than this, the nearest that the camera sees, no invalid pixel in its cone is "
      "taken as far");
    f("stop_m", &P::stop_m, 0, 10, "m", "ours", "a reading nearer than this says stop");
    f("max_age_s", &P::max_age_s, 0.01, 10, "s", "ours",
      "a reading speaks for frames that were taken at most so much earlier or later");
    f("lost_s", &P::lost_s, 0.1, 1e6, "s", "ours", "no echo for so long is the fault range_lost");
    f("stuck_s", &P::stuck_s, 0.1, 1e6, "s", "ours",
      "an echo line that does not move for so long is the fault range_stuck");
  }
};

/// Where far parts of the map go when it fills up, until the robot comes back.
struct ArchiveConfig {
  std::string dir;
  float max_bytes = 4e9f;

  template <class F>
  static void fields(F&& f) {
    using P = ArchiveConfig;
    f("dir", &P::dir, 0, 4000, "folder", "ours", "made when it is not there; empty: far parts are dropped");
    f("max_bytes", &P::max_bytes, 1e6, 1e15, "bytes", "ours",
      "of its files; when it is full far parts are dropped");
  }
};

enum class RecordColour : uint8_t { lossless, jpeg };

struct RecordConfig {
  bool masks = false;
  bool mesh = true;
  bool map = false;
  float map_every_s = 0;
  bool log = false;
  float log_max_bytes = 4e9f;
  float log_file_bytes = 256e6f;
  float log_file_s = 3600;
  float log_max_s = 0;
  float log_sync_s = 1;
  bool frames = false;
  RecordColour colour = RecordColour::lossless;
  float stream_bytes = 100e6f;
  int32_t streams_kept = 2;
  int32_t snapshots = 8;
  int32_t keep_previous = 3;

  template <class F>
  static void fields(F&& f) {
    using P = RecordConfig;
    f("masks", &P::masks, 0, 1, "bool", "III-C", "write masks/STAMP.png (and masks_truth/ where known)");
    f("mesh", &P::mesh, 0, 1, "bool", "III-A", "write mesh.ply at the end");
    f("map", &P::map, 0, 1, "bool", "ours", "write map.smap at the end");
    f("map_every_s", &P::map_every_s, 0, 1e6, "s", "ours",
      "with map: write it on the way as well, so often; 0: only at the end");
    f("log", &P::log, 0, 1, "bool", "ours", "write an LCM event log: poses, status and events");
    f("log_max_bytes", &P::log_max_bytes, 2e5, 1e15, "bytes", "ours",
      "of the log's files together; the oldest are deleted");
    f("log_file_bytes", &P::log_file_bytes, 1e5, 1e12, "bytes", "ours",
      "of one file of the log; then the next begins");
    f("log_file_s", &P::log_file_s, 1, 1e9, "s", "ours", "so does it after so long");
    f("log_max_s", &P::log_max_s, 0, 1e9, "s", "ours",
      "files of the log that were closed so long ago are deleted; 0: only log_max_bytes counts");
    f("log_sync_s", &P::log_sync_s, 0, 3600, "s", "ours",
      "so often the log is synced: the most that a power cut takes");
    f("frames", &P::frames, 0, 1, "bool", "ours",
      "with log: the images of each frame and what was decided about it, for `stillmap replay`");
    f("colour", &P::colour, 0, 1, "lossless|jpeg", "ours",
      "how the log keeps colour; depth is never changed");
    f("stream_bytes", &P::stream_bytes, 1e4, 1e12, "bytes", "ours",
      "of trajectory.txt, states.csv, timing.csv each; then the next begins, and this is NAME.1");
    f("streams_kept", &P::streams_kept, 0, 1000, "files", "ours", "NAME.1, NAME.2, ... kept of each");
    f("snapshots", &P::snapshots, 0, 1000, "frames", "Fig. 1",
      "frames kept with mask and reprojected map for `stillmap picture`");
    f("keep_previous", &P::keep_previous, 0, 100, "runs", "ours", "earlier runs kept in DIR/previous-N");
  }
};

/// What is done with a frame.
struct PipelineConfig {
  bool mapping = true;

  template <class F>
  static void fields(F&& f) {
    using P = PipelineConfig;
    f("mapping", &P::mapping, 0, 1, "bool", "ours",
      "false: poses in the map of --map, or of the first frame; nothing is added to it");
  }
};

/// What a camera does that is not found again.
struct LostConfig {
  float new_map_after_s = 0;

  template <class F>
  static void fields(F&& f) {
    using P = LostConfig;
    f("new_map_after_s", &P::new_map_after_s, 0, 1e6, "s", "ours",
      "lost for so long: the map is given up and a new one started; 0: never");
  }
};

/// What a planner may ask of a running program.
struct LcmConfig {
  bool commands = false;

  template <class F>
  static void fields(F&& f) {
    using P = LcmConfig;
    f("commands", &P::commands, 0, 1, "bool", "ours",
      "obey STILLMAP_COMMAND: anybody on the network can send it");
  }
};

/// Threads and deadlines. Priorities, CPU sets and locked memory are for live sources and --realtime; what
/// the system refuses is said and gone without.
struct RuntimeConfig {
  int32_t threads = 2;
  int32_t frame_slots = 6;
  float period_ms = 0;
  int32_t capture_priority = 60;
  int32_t realtime_priority = 50;
  int32_t publish_priority = 55;
  std::string realtime_cpus, other_cpus;
  bool lock_memory = false;

  template <class F>
  static void fields(F&& f) {
    using P = RuntimeConfig;
    f("threads", &P::threads, 1, 64, "threads", "ours", "of the CPU engine, the real-time thread included");
    f("frame_slots", &P::frame_slots, 4, 64, "frames", "ours",
      "live: frames in memory, from the camera to the disk; beyond them the newest wins");
    f("period_ms", &P::period_ms, 0, 1e4, "ms", "ours",
      "live: the deadline of a frame; 0: the camera's period");
    f("capture_priority", &P::capture_priority, 0, 99, "SCHED_FIFO", "ours", "live; 0: the usual scheduler");
    f("realtime_priority", &P::realtime_priority, 0, 99, "SCHED_FIFO", "ours",
      "live, of the thread that takes a frame to its pose; 0: the usual scheduler");
    f("publish_priority", &P::publish_priority, 0, 99, "SCHED_FIFO", "ours", "live; 0: the usual scheduler");
    f("realtime_cpus", &P::realtime_cpus, 0, 100, "CPU set", "ours",
      "live, of the thread that takes a frame to its pose: \"0,2-3\"; empty: any");
    f("other_cpus", &P::other_cpus, 0, 100, "CPU set", "ours",
      "live, of capture, publish and record; empty: any");
    f("lock_memory", &P::lock_memory, 0, 1, "bool", "ours", "live: no page of it is ever on disk");
  }
};

/// How a stop ends.
struct StopConfig {
  float timeout_s = 5;

  template <class F>
  static void fields(F&& f) {
    using P = StopConfig;
    f("timeout_s", &P::timeout_s, 0, 1e6, "s", "ours",
      "after a stop signal map and mesh are given up when they take longer");
  }
};

/// Numbers for dashboards.
struct MetricsConfig {
  int32_t port = 0;

  template <class F>
  static void fields(F&& f) {
    using P = MetricsConfig;
    f("port", &P::port, 0, 65535, "TCP port", "ours", "Prometheus text on 127.0.0.1; 0: off");
  }
};

struct MemoryConfig {
  int32_t budget_mb = 512;

  template <class F>
  static void fields(F&& f) {
    using P = MemoryConfig;
    f("budget_mb", &P::budget_mb, 1, 1000000, "MB", "ours", "a memory plan above it does not boot");
  }
};

struct Config {
  CameraConfig camera;
  SourceConfig source;
  MountConfig mount;
  OdometryConfig odometry;
  SonarConfig sonar;
  PipelineConfig pipeline;
  DepthParams depth;
  TrackParams track;
  MaskParams mask;
  IntegrateParams integrate;
  MapParams map;
  RelocaliseParams relocalise;
  ArchiveConfig archive;
  RecordConfig record;
  LostConfig lost;
  LcmConfig lcm;
  RuntimeConfig runtime;
  StopConfig stop;
  MetricsConfig metrics;
  MemoryConfig memory;

  /// Calls `f(section_name, pointer_to_section_member)` for each section, in the order of the files.
  template <class F>
  static void sections(F&& f) {
    f("camera", &Config::camera);
    f("source", &Config::source);
    f("mount", &Config::mount);
    f("odometry", &Config::odometry);
    f("sonar", &Config::sonar);
    f("pipeline", &Config::pipeline);
    f("depth", &Config::depth);
    f("track", &Config::track);
    f("mask", &Config::mask);
    f("integrate", &Config::integrate);
    f("map", &Config::map);
    f("relocalise", &Config::relocalise);
    f("archive", &Config::archive);
    f("record", &Config::record);
    f("lost", &Config::lost);
    f("lcm", &Config::lcm);
    f("runtime", &Config::runtime);
    f("stop", &Config::stop);
    f("metrics", &Config::metrics);
    f("memory", &Config::memory);
  }
};

}  // namespace stillmap
