#include "runtime/evaluate/ate.hpp"

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

#include <fmt/format.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

namespace stillmap {
namespace {

constexpr uint32_t kNone = UINT32_MAX;

/// Both trajectories on one time line, as a list from which matched poses are taken out. The nearest pair of
/// what is left always stands side by side in it, so the greedy choice looks at neighbours only.
class TimeLine {
 public:
  TimeLine(const Trajectory& truth, const Trajectory& estimate) {
    append(truth, true);
    append(estimate, false);
    std::sort(nodes_.begin(), nodes_.end(), [](const Node& a, const Node& b) {
      return std::make_tuple(a.stamp, !a.is_truth) < std::make_tuple(b.stamp, !b.is_truth);
    });
    for (uint32_t i = 0; i < nodes_.size(); ++i) {
      nodes_[i].before = i == 0 ? kNone : i - 1;
      nodes_[i].after = i + 1 == nodes_.size() ? kNone : i + 1;
    }
  }

  std::vector<PosePair> match(double max_dt_s) {
    max_dt_s_ = max_dt_s;
    std::vector<PosePair> pairs;
    for (uint32_t i = 0; i + 1 < nodes_.size(); ++i) offer(i, i + 1);
    while (!candidates_.empty()) {
      const Candidate best = candidates_.top();
      candidates_.pop();
      if (nodes_[best.truth].taken || nodes_[best.estimate].taken) continue;
      pairs.push_back({nodes_[best.truth].index, nodes_[best.estimate].index});
      take_out(best.truth);
      take_out(best.estimate);
    }
    std::sort(pairs.begin(), pairs.end(), [](PosePair a, PosePair b) { return a.truth < b.truth; });
    return pairs;
  }

 private:
  struct Node {
    Stamp stamp;
    double seconds = 0;
    uint32_t index = 0;  ///< in its trajectory
    uint32_t before = kNone, after = kNone;
    bool is_truth = false, taken = false;
  };
  struct Candidate {
    double dt_s = 0;
    uint32_t truth = 0, estimate = 0;  ///< nodes; they are in the order of the stamps
    bool operator>(const Candidate& other) const {
      return std::tie(dt_s, truth, estimate) > std::tie(other.dt_s, other.truth, other.estimate);
    }
  };

  void append(const Trajectory& trajectory, bool is_truth) {
    for (uint32_t i = 0; i < trajectory.poses.size(); ++i) {
      const Stamp stamp = trajectory.poses[i].stamp;
      nodes_.push_back({stamp, exact_seconds(stamp), i, kNone, kNone, is_truth, false});
    }
  }

  void offer(uint32_t left, uint32_t right) {
    if (left == kNone || right == kNone || nodes_[left].is_truth == nodes_[right].is_truth) return;
    // In doubles, as the benchmark's scripts do it: so equal differences are equal here when they are there.
    const double dt_s = std::abs(nodes_[left].seconds - nodes_[right].seconds);
    if (!(dt_s < max_dt_s_)) return;
    candidates_.push({dt_s, nodes_[left].is_truth ? left : right, nodes_[left].is_truth ? right : left});
  }

  void take_out(uint32_t i) {
    Node& node = nodes_[i];
    node.taken = true;
    if (node.before != kNone) nodes_[node.before].after = node.after;
    if (node.after != kNone) nodes_[node.after].before = node.before;
    offer(node.before, node.after);
  }

  std::vector<Node> nodes_;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> candidates_;
  double max_dt_s_ = 0;
};

Eigen::Vector3d position(const Trajectory& trajectory, uint32_t index) {
  const Vec3d& t = trajectory.poses[index].T_world_cam.translation;
  return {t.x, t.y, t.z};
}

Se3d to_se3(const Eigen::Matrix4d& t) {
  Se3d out;
  for (int row = 0; row < 3; ++row)
    for (int col = 0; col < 3; ++col) out.rotation.m[3 * row + col] = t(row, col);
  out.translation = {t(0, 3), t(1, 3), t(2, 3)};
  return out;
}

}  // namespace

std::vector<PosePair> associate(const Trajectory& truth, const Trajectory& estimate, double max_dt_s) {
  return TimeLine(truth, estimate).match(max_dt_s);
}

double AteResult::matched_share_estimate() const {
  return estimate_poses == 0 ? 0 : static_cast<double>(pairs.size()) / static_cast<double>(estimate_poses);
}
double AteResult::matched_share_truth() const {
  return truth_poses == 0 ? 0 : static_cast<double>(pairs.size()) / static_cast<double>(truth_poses);
}

Result<AteResult> absolute_trajectory_error(const Trajectory& truth, const Trajectory& estimate,
                                            double max_dt_s) {
  AteResult result;
  result.truth_poses = truth.poses.size();
  result.estimate_poses = estimate.poses.size();
  result.pairs = associate(truth, estimate, max_dt_s);
  if (result.pairs.size() < 2)
    return Error{
        fmt::format("{} of {} poses of the estimate have a truth within {} s; at least 2 are needed: are the "
                    "stamps of both files from the same clock?",
                    result.pairs.size(), result.estimate_poses, max_dt_s)};
  const Eigen::Index n = static_cast<Eigen::Index>(result.pairs.size());
  Eigen::Matrix3Xd p_truth(3, n), p_estimate(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const PosePair pair = result.pairs[static_cast<std::size_t>(i)];
    p_truth.col(i) = position(truth, pair.truth);
    p_estimate.col(i) = position(estimate, pair.estimate);
  }
  const Eigen::Matrix4d alignment = Eigen::umeyama(p_estimate, p_truth, false);
  result.T_truth_estimate = to_se3(alignment);
  const Eigen::Matrix3Xd difference =
      (alignment.topLeftCorner<3, 3>() * p_estimate).colwise() + alignment.topRightCorner<3, 1>() - p_truth;
  result.errors_m.resize(result.pairs.size());
  for (Eigen::Index i = 0; i < n; ++i)
    result.errors_m[static_cast<std::size_t>(i)] = difference.col(i).norm();
  result.translation_m = statistics_of(result.errors_m);
  return result;
}

}  // namespace stillmap
