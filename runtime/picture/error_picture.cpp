#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "runtime/picture/painters.hpp"
#include "runtime/picture/plot.hpp"
#include "runtime/picture/run_data.hpp"

namespace stillmap {
namespace {

constexpr double kPanel_px = 270, kHead_px = 44;
constexpr double kDegreesPerRadian = 57.29577951308232;

Eigen::Matrix3d matrix(const Mat3T<double>& r) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.m);
}

/// Angles between the orientations of each pair after the one rotation that fits them best. (The rotation of
/// ATE fits positions and says little about orientations when the camera hardly moves.)
std::vector<double> rotation_errors_deg(const Trajectory& truth, const Trajectory& estimate,
                                        const std::vector<PosePair>& pairs) {
  const auto rotation = [](const Trajectory& trajectory, uint32_t index) {
    return matrix(trajectory.poses[index].T_world_cam.rotation);
  };
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const PosePair& pair : pairs)
    sum += rotation(truth, pair.truth) * rotation(estimate, pair.estimate).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Eigen::Matrix3d fit =
      svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  std::vector<double> errors;
  for (const PosePair& pair : pairs) {
    const Eigen::Matrix3d error =
        rotation(truth, pair.truth).transpose() * fit * rotation(estimate, pair.estimate);
    Mat3T<double> r;
    for (int i = 0; i < 9; ++i) r.m[i] = error(i / 3, i % 3);
    errors.push_back(norm(log_rotation(r)) * kDegreesPerRadian);
  }
  return errors;
}

struct Panel {
  PlotLabels labels;
  std::vector<Point> values;
  Colour colour;
  double top = 0;  ///< of the axis
};

/// Time since the first stamp, so that axes read in seconds.
double since(Stamp stamp, Stamp start) {
  return static_cast<double>(stamp.ns - start.ns) * 1e-9;
}

Panel panel_of(const std::string& title, const std::string& y, Colour colour, std::vector<Point> values) {
  Panel panel{{title, "", y}, std::move(values), colour, 0};
  for (const Point& p : panel.values) panel.top = std::max(panel.top, p.y);
  panel.top = panel.top > 0 ? panel.top * 1.12 : 1;
  return panel;
}

void shade_states(Plot& plot, const std::vector<StateRow>& states, Stamp start) {
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= states.size(); ++i) {
    if (i < states.size() && states[i].state == states[begin].state) continue;
    const Stamp end = states[std::min(i, states.size() - 1)].stamp;
    if (states[begin].state != FrameState::good)
      plot.shade({since(states[begin].stamp, start), since(end, start)},
                 states[begin].state == FrameState::poor ? kPoorColour : kLostColour);
    begin = i;
  }
}

void add_error_panels(const RunInputs& inputs, Stamp start, std::vector<Panel>& panels) {
  if (!inputs.ate || !*inputs.ate) return;
  const AteResult& ate = **inputs.ate;
  const Trajectory &truth = **inputs.truth, &estimate = **inputs.estimate;
  const std::vector<double> rotation_deg = rotation_errors_deg(truth, estimate, ate.pairs);
  std::vector<Point> translation, rotation;
  for (std::size_t i = 0; i < ate.pairs.size(); ++i) {
    const double t_s = since(estimate.poses[ate.pairs[i].estimate].stamp, start);
    translation.push_back({t_s, 100 * ate.errors_m[i]});
    rotation.push_back({t_s, rotation_deg[i]});
  }
  const double rmse_deg = statistics_of(rotation_deg).rmse;
  panels.push_back(
      panel_of(fmt::format("Translation error after alignment: RMSE {:.2f} cm", 100 * ate.translation_m.rmse),
               "error [cm]", kEstimateColour, std::move(translation)));
  panels.push_back(panel_of(fmt::format("Rotation error after alignment: RMSE {:.2f} degrees", rmse_deg),
                            "error [deg]", kAccent, std::move(rotation)));
}

void add_state_panel(const std::vector<StateRow>& states, Stamp start, std::vector<Panel>& panels) {
  if (states.empty()) return;
  std::vector<Point> masked;
  double sum = 0;
  for (const StateRow& row : states) {
    masked.push_back({since(row.stamp, start), 100 * row.masked_fraction});
    sum += row.masked_fraction;
  }
  panels.push_back(panel_of(
      fmt::format("Masked as dynamic: {:.1f} % on average", 100 * sum / static_cast<double>(states.size())),
      "pixels [%]", {0.75, 0.15, 0.3, 1}, std::move(masked)));
}

}  // namespace

Painted paint_error(const RunInputs& inputs) {
  if (const std::optional<Error> error = inputs.broken()) return *error;
  std::vector<StateRow> states;
  if (have_file(inputs.path("states.csv"))) {
    Result<std::vector<StateRow>> rows = read_states(inputs.path("states.csv"));
    if (!rows) return Error{rows.error()};
    states = std::move(*rows);
  }
  const bool with_error = inputs.ate && *inputs.ate;
  if (states.empty() && !with_error)
    return Missing{inputs.path("states.csv") + " and a truth for trajectory.txt are not there"};
  Stamp start = states.empty() ? (*inputs.estimate)->poses.front().stamp : states.front().stamp;
  if (with_error) start = std::min(start, (*inputs.estimate)->poses.front().stamp);
  std::vector<Panel> panels;
  add_error_panels(inputs, start, panels);
  add_state_panel(states, start, panels);
  Range time;
  time.high = 0;
  for (const Panel& panel : panels)
    for (const Point& p : panel.values) time.high = std::max(time.high, p.x);
  Canvas canvas(kPageWidth_px, static_cast<int>(kHead_px + kPanel_px * static_cast<double>(panels.size())));
  canvas.text({20, 32}, "Error over time", {20, Align::left, true});
  const bool any_bad = std::any_of(states.begin(), states.end(),
                                   [](const StateRow& s) { return s.state != FrameState::good; });
  for (std::size_t i = 0; i < panels.size(); ++i) {
    Panel& panel = panels[i];
    panel.labels.x = "time [s]";
    Plot plot(canvas, {0, kHead_px + kPanel_px * static_cast<double>(i), kPageWidth_px, kPanel_px}, time,
              {0, panel.top}, panel.labels);
    shade_states(plot, states, start);
    plot.line(panel.values, panel.colour, 1.8);
    if (i == 0 && any_bad)
      plot.legend({{"tracking poor", kPoorColour, Mark::box}, {"tracking lost", kLostColour, Mark::box}},
                  panel.values);
  }
  return canvas;
}

}  // namespace stillmap
