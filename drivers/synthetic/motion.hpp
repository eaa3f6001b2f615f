#pragma once

// How things move in the scenes: smooth functions of time, seconds and metres.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "drivers/synthetic/builders.hpp"

namespace stillmap::synthetic {

inline constexpr double kTurn = 6.283185307179586;
inline constexpr double kDegree = kTurn / 360.0;

/// Place on the floor.
struct Spot2 {
  double x = 0, y = 0;
};
inline Spot2 operator+(Spot2 a, Spot2 b) {
  return {a.x + b.x, a.y + b.y};
}
inline Spot2 operator-(Spot2 a, Spot2 b) {
  return {a.x - b.x, a.y - b.y};
}
inline Spot2 operator*(double s, Spot2 a) {
  return {s * a.x, s * a.y};
}
inline Spot2 mixed(Spot2 a, Spot2 b, double share_of_b) {
  return a + share_of_b * (b - a);
}

/// 0 before `from_s`, 1 after `to_s`, between them without a jump in speed or acceleration.
inline double rise(double from_s, double to_s, double t_s) {
  const double x = t_s <= from_s ? 0.0 : t_s >= to_s ? 1.0 : (t_s - from_s) / (to_s - from_s);
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

/// Time that starts to run slowly: at full pace after `slow_s`.
inline double from_rest(double t_s, double slow_s = 1.0) {
  return t_s < slow_s ? 0.5 * t_s * t_s / slow_s : t_s - 0.5 * slow_s;
}

/// sin with a period in seconds and a start in turns.
inline double wave(double t_s, double period_s, double start = 0.0) {
  return std::sin(kTurn * (t_s / period_s + start));
}

/// Where to be when.
struct Waypoint {
  double t_s;
  Spot2 place;
};

/// Smooth curve through the waypoints; rests at the first before and at the last after.
inline Spot2 along(std::span<const Waypoint> way, double t_s) {
  if (t_s <= way.front().t_s) return way.front().place;
  if (t_s >= way.back().t_s) return way.back().place;
  size_t i = 0;
  while (t_s > way[i + 1].t_s) ++i;
  const auto slope = [&](size_t k) {  // at rest at both ends
    if (k == 0 || k + 1 == way.size()) return Spot2{};
    return (1.0 / (way[k + 1].t_s - way[k - 1].t_s)) * (way[k + 1].place - way[k - 1].place);
  };
  const double h = way[i + 1].t_s - way[i].t_s;
  const double x = (t_s - way[i].t_s) / h, x2 = x * x, x3 = x2 * x;
  return (2 * x3 - 3 * x2 + 1) * way[i].place + (h * (x3 - 2 * x2 + x)) * slope(i) +
         (3 * x2 - 2 * x3) * way[i + 1].place + (h * (x3 - x2)) * slope(i + 1);
}

/// A handheld camera that sways about a place.
struct Sway {
  Vec3d centre_m;
  Vec3d reach_m;
  Vec3d period_s;
  double yaw_deg = 0, yaw_reach_deg = 10, yaw_period_s = 6.1;
  double pitch_deg = -5, pitch_reach_deg = 3, pitch_period_s = 4.7;
};

inline Vec3d sway_place(const Sway& s, double t_s) {
  const double t = from_rest(t_s);
  return {s.centre_m.x + s.reach_m.x * wave(t, s.period_s.x, 0.25),
          s.centre_m.y + s.reach_m.y * wave(t, s.period_s.y),
          s.centre_m.z + s.reach_m.z * wave(t, s.period_s.z)};
}
inline double sway_yaw(const Sway& s, double t_s) {
  return kDegree * (s.yaw_deg + s.yaw_reach_deg * wave(from_rest(t_s), s.yaw_period_s));
}
inline double sway_pitch(const Sway& s, double t_s) {
  return kDegree * (s.pitch_deg + s.pitch_reach_deg * wave(from_rest(t_s), s.pitch_period_s));
}

/// Adds the small unrest of a hand.
inline Se3d handheld(Vec3d place_m, double yaw, double pitch, double t_s) {
  const double t = from_rest(t_s);
  const Vec3d shake = {0.004 * wave(t, 0.83), 0.005 * wave(t, 0.71), 0.006 * wave(t, 0.59)};
  return look(place_m + shake, yaw + 0.3 * kDegree * wave(t, 0.77), pitch + 0.4 * kDegree * wave(t, 0.63),
              1.5 * kDegree * wave(t, 2.9));
}

inline Se3d sway_camera(const Sway& s, double t_s) {
  return handheld(sway_place(s, t_s), sway_yaw(s, t_s), sway_pitch(s, t_s), t_s);
}

/// A person on `path` (seconds to Spot2) who turns into the walking direction, and towards `facing` when
/// slow.
/// @param facing direction; the longer, the less the person turns away from it (m/s)
template <class Path>
Stance walk(const Path& path, double t_s, Spot2 facing) {
  const Spot2 here = path(t_s);
  const Spot2 velocity = (1.0 / 0.6) * (path(t_s + 0.3) - path(t_s - 0.3));
  // Nobody turns on the spot: the direction is the mean over a second.
  Spot2 front;
  for (int i = -4; i <= 4; ++i) {
    const double at_s = t_s + 0.12 * i;
    const Spot2 step = (1.0 / 0.6) * (path(at_s + 0.3) - path(at_s - 0.3)) + facing;
    front = front + (1.0 / std::max(std::hypot(step.x, step.y), 1e-6)) * step;
  }
  const double speed = std::hypot(velocity.x, velocity.y);
  Stance stance;
  stance.feet_m = {static_cast<float>(here.x), static_cast<float>(here.y), 0.0f};
  stance.yaw = static_cast<float>(std::atan2(front.y, front.x));
  stance.stride = static_cast<float>(std::min(1.0, 0.06 + speed / 1.1));
  stance.phase = static_cast<float>(std::fmod(kTurn * 0.85 * t_s + 2.0 * here.x, kTurn));
  return stance;
}

/// Point `ahead_m` before and `height_m` above the feet of a stance.
inline Vec3 before(const Stance& stance, float ahead_m, float height_m) {
  return stance.feet_m + Vec3{ahead_m * std::cos(stance.yaw), ahead_m * std::sin(stance.yaw), height_m};
}

}  // namespace stillmap::synthetic
