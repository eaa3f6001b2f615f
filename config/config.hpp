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
  }
};

struct SourceConfig {
  float wait_s = 0;
  float stall_s = 1;
  float time_offset_ms = 0;
  float max_pair_ms = 20;

  template <class F>
  static void fields(F&& f) {
    using P = SourceConfig;
    f("wait_s", &P::wait_s, -1, 1e9, "s", "ours", "how long to wait for the source to appear; -1: for ever");
    f("stall_s", &P::stall_s, 0.05, 1e6, "s", "ours",
      "live: no frame for so long is the fault camera_stalled");
    f("time_offset_ms", &P::time_offset_ms, -1e4, 1e4, "ms", "ours",
      "added to the colour stamp before pairing");
    f("max_pair_ms", &P::max_pair_ms, 0, 1000, "ms", "ours", "largest distance of the stamps of a pair");
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

struct RecordConfig {
  bool masks = false;
  bool mesh = true;
  bool map = false;
  float map_every_s = 0;
  bool log = false;
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
    f("log", &P::log, 0, 1, "bool", "ours", "write an LCM event log");
    f("snapshots", &P::snapshots, 0, 1000, "frames", "Fig. 1",
      "frames kept with mask and reprojected map for `stillmap picture`");
    f("keep_previous", &P::keep_previous, 0, 100, "runs", "ours", "earlier runs kept in DIR/previous-N");
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
