#pragma once

// The TUM benchmark's definitions once more, written for nothing but being evident: every pair is looked at,
// the alignment is Horn's (largest eigenvector of his 4x4 matrix), poses are 4x4 matrices, nearest means a
// linear scan.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

namespace stillmap::test {

struct NaivePose {
  double stamp_s;
  Eigen::Matrix4d T;
};
using NaiveTrajectory = std::vector<NaivePose>;

inline std::vector<std::pair<std::size_t, std::size_t>> naive_associate(const NaiveTrajectory& truth,
                                                                        const NaiveTrajectory& estimate,
                                                                        double max_dt_s) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> all;
  for (std::size_t i = 0; i < truth.size(); ++i)
    for (std::size_t j = 0; j < estimate.size(); ++j) {
      const double dt = std::fabs(truth[i].stamp_s - estimate[j].stamp_s);
      if (dt < max_dt_s) all.emplace_back(dt, i, j);
    }
  std::sort(all.begin(), all.end());
  std::vector<bool> truth_used(truth.size()), estimate_used(estimate.size());
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const auto& [dt, i, j] : all) {
    if (truth_used[i] || estimate_used[j]) continue;
    truth_used[i] = estimate_used[j] = true;
    pairs.emplace_back(i, j);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

/// Errors after the alignment.
inline std::vector<double> naive_ate(const NaiveTrajectory& truth, const NaiveTrajectory& estimate,
                                     double max_dt_s) {
  const auto pairs = naive_associate(truth, estimate, max_dt_s);
  Eigen::Vector3d mean_t = Eigen::Vector3d::Zero(), mean_e = Eigen::Vector3d::Zero();
  for (const auto& [i, j] : pairs) {
    mean_t += truth[i].T.block<3, 1>(0, 3) / static_cast<double>(pairs.size());
    mean_e += estimate[j].T.block<3, 1>(0, 3) / static_cast<double>(pairs.size());
  }
  Eigen::Matrix3d s = Eigen::Matrix3d::Zero();
  for (const auto& [i, j] : pairs)
    s += (estimate[j].T.block<3, 1>(0, 3) - mean_e) * (truth[i].T.block<3, 1>(0, 3) - mean_t).transpose();
  Eigen::Matrix4d n;
  n << s(0, 0) + s(1, 1) + s(2, 2), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0),  //
      s(1, 2) - s(2, 1), s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2),   //
      s(2, 0) - s(0, 2), s(0, 1) + s(1, 0), -s(0, 0) + s(1, 1) - s(2, 2), s(1, 2) + s(2, 1),  //
      s(0, 1) - s(1, 0), s(2, 0) + s(0, 2), s(1, 2) + s(2, 1), -s(0, 0) - s(1, 1) + s(2, 2);
  const Eigen::Vector4d q = Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(n).eigenvectors().col(3);
  const Eigen::Matrix3d r = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  std::vector<double> errors;
  for (const auto& [i, j] : pairs)
    errors.push_back(
        (r * (estimate[j].T.block<3, 1>(0, 3) - mean_e) - (truth[i].T.block<3, 1>(0, 3) - mean_t)).norm());
  return errors;
}

inline std::size_t naive_nearest(const NaiveTrajectory& trajectory, double t) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < trajectory.size(); ++i)
    if (std::fabs(trajectory[i].stamp_s - t) < std::fabs(trajectory[best].stamp_s - t)) best = i;
  return best;
}

/// Translation [m] and rotation [deg] of every pair.
inline std::vector<std::pair<double, double>> naive_rpe(const NaiveTrajectory& truth,
                                                        const NaiveTrajectory& estimate, double delta_s) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < truth.size(); ++i) intervals.push_back(truth[i].stamp_s - truth[i - 1].stamp_s);
  std::sort(intervals.begin(), intervals.end());
  const std::size_t m = intervals.size() / 2;
  const double median = intervals.size() % 2 == 1 ? intervals[m] : 0.5 * (intervals[m - 1] + intervals[m]);
  std::vector<std::pair<double, double>> errors;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const std::size_t j = naive_nearest(estimate, estimate[i].stamp_s + delta_s);
    if (j == estimate.size() - 1) continue;
    const std::size_t a = naive_nearest(truth, estimate[i].stamp_s),
                      b = naive_nearest(truth, estimate[j].stamp_s);
    if (std::fabs(truth[a].stamp_s - estimate[i].stamp_s) > 2 * median) continue;
    if (std::fabs(truth[b].stamp_s - estimate[j].stamp_s) > 2 * median) continue;
    const Eigen::Matrix4d estimate_motion = estimate[j].T.inverse() * estimate[i].T;
    const Eigen::Matrix4d truth_motion = truth[b].T.inverse() * truth[a].T;
    const Eigen::Matrix4d error = estimate_motion.inverse() * truth_motion;
    const double cosine = std::clamp((error.block<3, 3>(0, 0).trace() - 1) / 2, -1.0, 1.0);
    errors.emplace_back(error.block<3, 1>(0, 3).norm(), std::acos(cosine) * 180 / M_PI);
  }
  return errors;
}

}  // namespace stillmap::test
