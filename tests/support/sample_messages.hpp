#pragma once

// One message of each kind, every member different from its default and from its neighbours.

#include <cmath>
#include <cstring>
#include <limits>

#include "runtime/ports/messages.hpp"

namespace stillmap::samples {

inline PoseMessage pose() {
  PoseMessage m;
  m.utime.us = 1764000000123456;
  for (int i = 0; i < 3; ++i) {
    m.pos_m[i] = 1.25 + i;
    m.vel_m_s[i] = -0.5 * i;
    m.rotation_rate_rad_s[i] = 0.01 * (i + 1);
    m.accel_m_s2[i] = std::numeric_limits<double>::quiet_NaN();
  }
  m.orientation_wxyz[0] = 0.5, m.orientation_wxyz[1] = -0.5, m.orientation_wxyz[2] = 0.5,
  m.orientation_wxyz[3] = -0.5;
  return m;
}

inline StatusMessage status() {
  StatusMessage m;
  m.utime.us = 1764000000123457;
  m.frame = 4000000001u;  // needs all 32 bits
  m.mode = Mode::degraded;
  m.state = 1;
  m.shed = Shed::finest_level;
  for (int i = 0; i < 21; ++i) m.covariance[i] = 1e-6f * static_cast<float>(i + 1);
  m.p_good = 0.75f, m.inlier_ratio = 0.5f, m.masked_fraction = 0.25f;
  m.prepare_ms = 1.5f, m.track_ms = 2.5f, m.mask_ms = 3.5f, m.refine_ms = 4.5f, m.integrate_ms = 5.5f;
  m.total_ms = 17.5f, m.pose_age_ms = 12.25f, m.rate_hz = 29.97f, m.map_fill = 0.125f;
  m.map_blocks = 54321, m.frames_dropped = 11, m.results_dropped = 12, m.deadline_misses = 13;
  m.faults_latched = 0x8000000000C00005, m.faults_active = 0x400001;
  for (uint32_t i = 0; i < kFaults; ++i) m.fault_count[i] = 100 + i;
  m.pose_epoch = 7, m.map_id = 0xFEDCBA9876543210, m.command_id = 0x89ABCDEF;
  m.command_result = CommandResult::failed;
  return m;
}

inline RangeMessage range() {
  return {{1764000000123458}, 0.37f, 4.5f, true, true};
}

inline CommandMessage command() {
  CommandMessage m;
  m.utime.us = 1764000000123459;
  m.id = 77;
  m.command = Command::save_mesh;
  std::strcpy(m.file.data(), "hall.ply");
  return m;
}

inline constexpr uint8_t kDepth[] = {1, 0, 255, 4, 5};
inline constexpr uint8_t kColour[] = {9, 8, 0, 6, 5, 4, 3};

inline FrameMessage frame() {
  FrameMessage m;
  m.utime.us = 1764000000123460;
  m.depth_stamp.ns = 33333333, m.colour_stamp.ns = -5;
  m.sequence = 3000000000u;
  m.depth_coding = ImageCoding::zstd_depth, m.colour_coding = ImageCoding::jpeg;
  m.depth = {kDepth, sizeof kDepth}, m.colour = {kColour, sizeof kColour};
  m.crc32c = 0xDEADBEEF;
  return m;
}

inline Se3d transform(double about) {
  return exp(Twistd{{about, 2 * about, -1}, {0.5, -about, 0.1}});
}

inline DecisionMessage decision() {
  DecisionMessage m;
  m.utime.us = 1764000000123461;
  m.sequence = 5;
  m.used = true, m.shed = Shed::every_second_integration, m.integrated = false, m.new_map = true;
  m.archive_answers = 9;
  m.odometry_answers = kOdometryAnswers;
  for (int i = 0; i < 2; ++i) {
    m.odometry[i].asked.ns = 123456789012345 + i;
    m.odometry[i].sample = {Stamp{123456789000000 + i}, transform(0.1 * (i + 1))};
  }
  m.sonar_m = 0.21f;
  return m;
}

inline SessionMessage session() {
  SessionMessage m;
  m.utime.us = 1764000000123462;
  m.version = "0.1.0", m.source = "tum:/data/fr1 \xC3\xA4", m.config_toml = "[track]\nprior = \"odometry\"\n";
  m.width = 640, m.height = 480;
  for (int i = 0; i < 4; ++i) m.k[i] = 500.5 + i;
  for (int i = 0; i < 5; ++i) m.distortion[i] = -0.1 * i;
  m.depth_units_per_m = 5000;
  for (int i = 0; i < 4; ++i) m.depth_bias[i] = 0.25 * (i + 1);
  m.T_map_cam = transform(0.3), m.map = "/maps/hall.smap";
  return m;
}

inline EventMessage event() {
  return {{1764000000123463}, true, "camera_stalled", "no frame for 1.0 s"};
}

}  // namespace stillmap::samples
