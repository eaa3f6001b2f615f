#include "runtime/evaluate/accuracy_files.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "runtime/evaluate/accuracy_bars.hpp"
#include "runtime/evaluate/accuracy_table.hpp"
#include "runtime/evaluate/trajectory.hpp"

namespace stillmap {
namespace {

using Json = nlohmann::ordered_json;

std::string cell(double value) {
  return std::isnan(value) ? std::string() : fmt::format("{:.7g}", value);
}

/// Scenes have commas in their names; quotes and line ends have no place in them.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' || c == '\n' ? '\'' : c;
  return out + "\"";
}

void put_figures(Json& json, const AccuracyFigures& figures) {
  AccuracyFigures::fields([&](const char* name, double AccuracyFigures::*figure, Worst) {
    json[name] = figures.*figure;  // NaN becomes null
  });
}

const char* state_name(TrackingState state) {
  return state == TrackingState::good ? "good" : state == TrackingState::poor ? "poor" : "lost";
}

}  // namespace

std::string accuracy_csv(const std::vector<AccuracyRun>& runs) {
  std::string csv = "scene,preset,seed,source,exit_code,error";
  AccuracyFigures::fields(
      [&](const char* name, double AccuracyFigures::*, Worst) { csv.append(",").append(name); });
  csv += "\n";
  for (const AccuracyRun& run : runs) {
    csv += fmt::format("{},{},{},{},{},{}", quoted(run.scene), quoted(run.preset), run.seed,
                       quoted(run.source), run.exit_code, quoted(run.error));
    AccuracyFigures::fields([&](const char*, double AccuracyFigures::*figure, Worst) {
      csv.append(",").append(cell(run.figures.*figure));
    });
    csv += "\n";
  }
  return csv;
}

std::string calibration_csv_head() {
  return "scene,preset,seed,stamp,state,p_good,inlier_ratio,error_m,error_deg,static_share,"
         "static_share_of_view,chi2,mask_iou,static_masked\n";
}

std::string calibration_csv(const AccuracyRun& run, const std::vector<FrameAgainstTruth>& frames) {
  std::string csv;
  for (const FrameAgainstTruth& f : frames)
    csv += fmt::format("{},{},{},{},{},{:.4f},{:.4f},{},{},{},{},{},{},{}\n", quoted(run.scene),
                       quoted(run.preset), run.seed, stamp_text(f.stamp), state_name(f.state), f.p_good,
                       f.inlier_ratio, cell(f.pose.error_m), cell(f.pose.error_deg),
                       cell(f.static_share.of_valid), cell(f.static_share.of_view), cell(f.pose.chi2),
                       cell(f.mask_iou), cell(f.static_masked));
  return csv;
}

std::string accuracy_json(const std::vector<AccuracyRun>& runs) {
  Json json = {{"runs", Json::array()}, {"summary", Json::array()}, {"bars", Json::array()}};
  for (const AccuracyRun& run : runs) {
    Json row = {{"scene", run.scene},
                {"preset", run.preset},
                {"seed", run.seed},
                {"source", run.source},
                {"exit_code", run.exit_code}};
    if (!run.error.empty()) row["error"] = run.error;
    put_figures(row, run.figures);
    json["runs"].push_back(std::move(row));
  }
  for (const AccuracySummary& s : summarise(runs)) {
    Json row = {{"scene", s.scene}, {"preset", s.preset}, {"runs", s.runs}, {"failed", s.failed}};
    put_figures(row["median"], s.median);
    put_figures(row["worst"], s.worst);
    json["summary"].push_back(std::move(row));
  }
  for (const std::string& preset : presets_of(runs))
    for (const Bar& bar : judge(runs, preset, yardstick_for(runs, preset)))
      json["bars"].push_back({{"preset", preset},
                              {"bar", bar.what},
                              {"verdict", to_string(bar.verdict)},
                              {"scene", bar.scene},
                              {"value", bar.value},
                              {"limit", bar.limit},
                              {"unit", bar.unit},
                              {"cases", bar.cases}});
  return json.dump(2);
}

}  // namespace stillmap
