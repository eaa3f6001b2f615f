#pragma once

// Random truth and estimate: different rates, jitter, gaps, noise, and another frame.

#include <cmath>
#include <random>
#include <string>

#include <fmt/format.h>

#include "runtime/evaluate/trajectory.hpp"
#include "tests/unit/runtime/evaluate/naive.hpp"

namespace stillmap::test {

struct MadePair {
  Trajectory truth, estimate;
  NaiveTrajectory naive_truth, naive_estimate;
};

inline Eigen::Matrix4d path_at(double t) {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.block<3, 3>(0, 0) = (Eigen::AngleAxisd(0.8 * std::sin(0.7 * t), Eigen::Vector3d::UnitY()) *
                         Eigen::AngleAxisd(0.3 * std::cos(1.1 * t), Eigen::Vector3d::UnitX()))
                            .toRotationMatrix();
  T.block<3, 1>(0, 3) << 1.5 * std::sin(0.5 * t), 0.2 * std::sin(1.7 * t), 0.9 * std::cos(0.4 * t);
  return T;
}

inline Se3d se3_of(const Eigen::Matrix4d& T) {
  Se3d out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out.rotation.m[3 * r + c] = T(r, c);
  out.translation = {T(0, 3), T(1, 3), T(2, 3)};
  return out;
}

inline void add_pose(Trajectory& trajectory, NaiveTrajectory& naive, int64_t ns, const Eigen::Matrix4d& T) {
  if (!naive.empty() && trajectory.poses.back().stamp.ns >= ns) return;
  trajectory.poses.push_back({Stamp{ns}, se3_of(T)});
  naive.push_back({std::strtod(stamp_text(Stamp{ns}).c_str(), nullptr), T});
}

inline MadePair make_pair_of_trajectories(uint64_t seed, double start_s, double seconds = 12) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> unit(0, 1);
  const Eigen::Matrix4d frame = path_at(100 * unit(random));
  MadePair made;
  const auto stamp_ns = [&](double t) {  // microseconds, as in the data sets
    return static_cast<int64_t>(std::llround((start_s + t) * 1e6)) * 1000;
  };
  const double gap_s = seconds * (0.2 + 0.5 * unit(random));
  for (double t = 0; t < seconds; t += 0.01) {
    if (t > gap_s - 1.5 && t < gap_s - 1.2) continue;  // the truth has gaps too
    const double at = t + 0.002 * unit(random);
    add_pose(made.truth, made.naive_truth, stamp_ns(at), path_at(at));
  }
  for (double t = -0.2; t < seconds + 0.3; t += 1.0 / 30) {
    if (t > gap_s && t < gap_s + 1.7) continue;
    const double at = t + 0.006 * (unit(random) - 0.5);
    Eigen::Matrix4d T = path_at(at);
    T.block<3, 1>(0, 3) += 0.02 * Eigen::Vector3d(noise(random), noise(random), noise(random));
    T.block<3, 3>(0, 0) =
        T.block<3, 3>(0, 0).eval() *
        Eigen::AngleAxisd(0.02 * noise(random), Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    add_pose(made.estimate, made.naive_estimate, stamp_ns(at), frame * T);
  }
  return made;
}

}  // namespace stillmap::test
