#include "firmware-like/commands/accuracy_run.hpp"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/run.hpp"
#include "runtime/evaluate/ate.hpp"
#include "runtime/evaluate/model.hpp"
#include "runtime/evaluate/ply_reader.hpp"
#include "runtime/evaluate/rpe.hpp"

namespace stillmap {
namespace {

using Json = nlohmann::ordered_json;

constexpr float kThere_m = 0.02f;  ///< a surface with mesh this near is in the map

double figure(uint64_t count) {
  return static_cast<double>(count);
}

/// Each of these @return the error, or empty.
std::string add_report(const std::string& path, AccuracyFigures& figures) {
  std::ifstream file(path);
  const Json json = Json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return path + ": cannot be read";
  figures.frames = json.value("frames", kUnknown);
  figures.lost_frames = json.value("lost_frames", kUnknown);
  figures.masked_fraction_mean = json.value("masked_fraction_mean", kUnknown);
  figures.total_ms_p50 = json.value("/ms/total/p50"_json_pointer, kUnknown);
  return {};
}

std::string add_trajectory(const std::string& truth_path, const std::string& estimate_path,
                           AccuracyFigures& figures) {
  const auto truth = read_trajectory(truth_path), estimate = read_trajectory(estimate_path);
  if (!truth || !estimate) return truth ? estimate.error() : truth.error();
  const auto ate = absolute_trajectory_error(*truth, *estimate);
  if (!ate) return ate.error();
  figures.ate_rmse_m = ate->translation_m.rmse;
  const auto rpe = relative_pose_error(*truth, *estimate);
  if (!rpe) return {};  // shorter than the second that it is measured over
  figures.rpe_rmse_m = rpe->translation_m.rmse;
  figures.rpe_rmse_deg = rpe->rotation_deg.rmse;
  return {};
}

void add_observed(const TruthObserver& truth, AccuracyFigures& figures) {
  figures.mask_iou = truth.masks().iou();
  figures.static_masked = truth.masks().static_masked();
  figures.still_masked = truth.masks().still_masked();
  const PoseCounts& poses = truth.poses();
  if (poses.frames == 0) return;
  figures.undeclared_loss = figure(poses.undeclared_loss);
  figures.declared_loss = figure(poses.declared_loss);
  figures.good = figure(poses.good);
  figures.good_off = figure(poses.good_off);
  figures.in_view = figure(poses.in_view);
  figures.in_view_good = figure(poses.in_view_good);
  figures.chi2_frames = figure(poses.chi2_frames);
  figures.chi2_inside = figure(poses.chi2_inside);
  figures.end_error_m = poses.end_error_m;
  figures.path_m = poses.path_m;
}

std::string add_mesh(const std::string& folder, const TruthObserver& truth, AccuracyFigures& figures) {
  const std::string cloud = folder + "/truth_cloud.ply", mesh = folder + "/mesh.ply";
  if (!std::filesystem::exists(cloud)) return {};  // of a recording nobody knows the surface
  const auto model = evaluate_model(cloud, mesh);
  if (!model) return model.error();
  figures.within_2cm = model->to_surface.within_2cm;
  figures.ghosts = model->to_surface.ghosts;
  const auto vertices = read_ply_mesh(mesh);
  if (!vertices) return vertices.error();
  figures.completeness = share_within(truth.seen_surface_map(), vertices->vertices_m, kThere_m);
  return {};
}

}  // namespace

AccuracyOutcome run_job(const AccuracyJob& job, bool keep_meshes) {
  AccuracyOutcome outcome{job.run, {}};
  AccuracyRun& r = outcome.run;
  const std::string& folder = job.options.out;
  TruthObserver truth;
  r.exit_code = run(job.options, &truth);
  if (r.exit_code != kExitDone && r.exit_code != kExitLost) {
    r.error = "the run failed";
    return outcome;
  }
  outcome.frames = truth.frames();
  add_observed(truth, r.figures);
  r.error = add_report(folder + "/report.json", r.figures);
  if (r.error.empty())
    r.error = add_trajectory(job.truth.empty() ? folder + "/truth.txt" : job.truth,
                             folder + "/trajectory.txt", r.figures);
  if (r.error.empty()) r.error = add_mesh(folder, truth, r.figures);
  std::error_code ignored;
  for (const char* file : {"/mesh.ply", "/truth_cloud.ply"})
    if (!keep_meshes) std::filesystem::remove(folder + file, ignored);
  return outcome;
}

}  // namespace stillmap
