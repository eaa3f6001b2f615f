#include "runtime/evaluate/rpe.hpp"

#include <cmath>

#include <fmt/format.h>

namespace stillmap {
namespace {

constexpr double kDegreesPerRadian = 57.29577951308232;

std::vector<double> stamps_s(const Trajectory& trajectory) {
  std::vector<double> stamps;
  stamps.reserve(trajectory.poses.size());
  for (const TimedPose& pose : trajectory.poses) stamps.push_back(exact_seconds(pose.stamp));
  return stamps;
}

/// Index of the stamp nearest to `t_s`. Of two equally near ones the first that the bisection meets, as in
/// the benchmark's script: on truth sampled exactly between the frames every stamp is such a tie.
std::size_t nearest(const std::vector<double>& stamps, double t_s) {
  std::size_t begin = 0, end = stamps.size(), best = 0;
  double best_dt = std::abs(stamps[0] - t_s);
  while (begin < end) {
    const std::size_t middle = (begin + end) / 2;
    const double dt = std::abs(stamps[middle] - t_s);
    if (dt < best_dt) {
      best_dt = dt;
      best = middle;
    }
    if (dt == 0) return middle;
    if (stamps[middle] > t_s)
      end = middle;
    else
      begin = middle + 1;
  }
  return best;
}

double median_interval(const std::vector<double>& stamps) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < stamps.size(); ++i) intervals.push_back(stamps[i] - stamps[i - 1]);
  return statistics_of(std::move(intervals)).median;
}

RpeSample compare(Stamp stamp, const Se3d& p0, const Se3d& p1, const Se3d& q0, const Se3d& q1) {
  const Se3d estimate = inverse(p0) * p1, truth_back = inverse(q1) * q0;
  const Se3d error = estimate * truth_back;
  return {stamp, norm(error.translation), norm((truth_back * estimate).translation),
          norm(log_rotation(error.rotation)) * kDegreesPerRadian};
}

Statistics summary(const std::vector<RpeSample>& samples, double RpeSample::*member) {
  std::vector<double> values;
  values.reserve(samples.size());
  for (const RpeSample& sample : samples) values.push_back(sample.*member);
  return statistics_of(std::move(values));
}

}  // namespace

Result<RpeResult> relative_pose_error(const Trajectory& truth, const Trajectory& estimate, double delta_s) {
  const std::vector<double> truth_s = stamps_s(truth), estimate_s = stamps_s(estimate);
  RpeResult result;
  result.truth_poses = truth_s.size();
  result.estimate_poses = estimate_s.size();
  if (truth_s.size() < 2 || estimate_s.size() < 2)
    return Error{fmt::format("{} poses of truth and {} of the estimate; at least 2 of each are needed",
                             truth_s.size(), estimate_s.size())};
  const double max_dt_s = 2 * median_interval(truth_s);
  bool any_motion =
      false;  // the script pairs a pose with itself before a gap; if all are such, nothing was compared
  for (std::size_t i = 0; i < estimate_s.size(); ++i) {
    const std::size_t j = nearest(estimate_s, estimate_s[i] + delta_s);
    if (j + 1 == estimate_s.size()) continue;
    const std::size_t truth_i = nearest(truth_s, estimate_s[i]), truth_j = nearest(truth_s, estimate_s[j]);
    if (std::abs(truth_s[truth_i] - estimate_s[i]) > max_dt_s ||
        std::abs(truth_s[truth_j] - estimate_s[j]) > max_dt_s)
      continue;
    any_motion = any_motion || j != i;
    result.samples.push_back(compare(estimate.poses[i].stamp, estimate.poses[i].T_world_cam,
                                     estimate.poses[j].T_world_cam, truth.poses[truth_i].T_world_cam,
                                     truth.poses[truth_j].T_world_cam));
  }
  if (result.samples.size() < 2 || !any_motion)
    return Error{
        fmt::format("{} pairs of poses {} s apart have a truth; at least 2 are needed: is the delta "
                    "between the frame interval and the length of the trajectory, and are the stamps of both "
                    "files from the same clock?",
                    any_motion ? result.samples.size() : 0, delta_s)};
  result.translation_m = summary(result.samples, &RpeSample::translation_m);
  result.translation_eq2_m = summary(result.samples, &RpeSample::translation_eq2_m);
  result.rotation_deg = summary(result.samples, &RpeSample::rotation_deg);
  return result;
}

std::string rpe_csv(const RpeResult& result) {
  std::string csv = "stamp,trans_m,rot_deg\n";
  for (const RpeSample& s : result.samples)
    csv += fmt::format("{},{:.9f},{:.9f}\n", stamp_text(s.stamp), s.translation_m, s.rotation_deg);
  return csv;
}

}  // namespace stillmap
