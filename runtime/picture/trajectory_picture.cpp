#include <algorithm>

#include <fmt/format.h>

#include "runtime/picture/painters.hpp"
#include "runtime/picture/plot.hpp"

namespace stillmap {
namespace {

constexpr double kHeight_px = 640, kHead_px = 44;

/// A path in the map frame: x right, height up (the first camera's y points down), depth away from the first
/// camera.
struct Path {
  std::vector<Point> top, side;

  void add(Vec3d p) {
    top.push_back({p.x, p.z});
    side.push_back({p.z, -p.y});
  }
};

Path path_of(const Trajectory& trajectory, const Se3d& T_map_world, int64_t from_ns, int64_t to_ns) {
  Path path;
  for (const TimedPose& pose : trajectory.poses)
    if (pose.stamp.ns >= from_ns && pose.stamp.ns <= to_ns)
      path.add(T_map_world * pose.T_world_cam.translation);
  return path;
}

void draw_view(Canvas& canvas, const Rect& outer, std::vector<Point> Path::*view, const Path& estimate,
               const Path& truth, const PlotLabels& labels) {
  std::vector<double> xs, ys;
  for (const Path* path : {&estimate, &truth})
    for (const Point& p : path->*view) {
      xs.push_back(p.x);
      ys.push_back(p.y);
    }
  Range x = range_of(xs), y = range_of(ys);
  if (std::max(x.span(), y.span()) < 0.02) y = {y.low - 0.01, y.high + 0.01};  // a camera that stands still
  Plot::make_equal(outer, x, y);
  Plot plot(canvas, outer, x, y, labels);
  plot.line(truth.*view, kTruthColour, 5);
  plot.line(estimate.*view, kEstimateColour, 1.8);
  plot.dot((estimate.*view).front(), 5, kAccent);
  std::vector<LegendItem> legend;
  if (!(truth.*view).empty()) legend.push_back({"truth", kTruthColour});
  legend.push_back({"estimate", kEstimateColour});
  legend.push_back({"start", kAccent, Mark::dot});
  std::vector<Point> drawn = estimate.*view;
  drawn.insert(drawn.end(), (truth.*view).begin(), (truth.*view).end());
  plot.legend(legend, drawn);
}

std::string title_of(const RunInputs& inputs) {
  if (!inputs.ate) return "Trajectory (no truth given)";
  if (!*inputs.ate) return "Trajectory (no pose has a truth at its time)";
  const AteResult& ate = **inputs.ate;
  return fmt::format("Trajectory: ATE RMSE {:.2f} cm, largest {:.2f} cm, {} of {} poses matched",
                     100 * ate.translation_m.rmse, 100 * ate.translation_m.max, ate.pairs.size(),
                     ate.estimate_poses);
}

}  // namespace

Painted paint_trajectory(const RunInputs& inputs) {
  if (!inputs.estimate) return Missing{inputs.path("trajectory.txt") + " is not there"};
  if (const std::optional<Error> error = inputs.broken()) return *error;
  const Trajectory& poses = **inputs.estimate;
  const Path estimate = path_of(poses, {}, INT64_MIN, INT64_MAX);
  Path truth;
  if (inputs.ate && *inputs.ate)
    truth = path_of(**inputs.truth, inverse((*inputs.ate)->T_truth_estimate),
                    poses.poses.front().stamp.ns - 50'000'000, poses.poses.back().stamp.ns + 50'000'000);
  Canvas canvas(kPageWidth_px, static_cast<int>(kHeight_px));
  canvas.text({20, 32}, title_of(inputs), {20, Align::left, true});
  const double half = kPageWidth_px / 2.0;
  draw_view(canvas, {0, kHead_px, half, kHeight_px - kHead_px}, &Path::top, estimate, truth,
            {"from above", "x [m]", "z [m]"});
  draw_view(canvas, {half, kHead_px, half, kHeight_px - kHead_px}, &Path::side, estimate, truth,
            {"from the side", "z [m]", "height, -y [m]"});
  return canvas;
}

}  // namespace stillmap
