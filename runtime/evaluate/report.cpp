#include "runtime/evaluate/report.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace stillmap {
namespace {

using Json = nlohmann::ordered_json;

/// Members `rmse_m`, `mean_m` and so on for the unit "m", behind `prefix`.
void put(Json& json, const std::string& prefix, const Statistics& s, const std::string& unit) {
  json[prefix + "rmse_" + unit] = s.rmse;
  json[prefix + "mean_" + unit] = s.mean;
  json[prefix + "median_" + unit] = s.median;
  json[prefix + "std_" + unit] = s.std;
  json[prefix + "min_" + unit] = s.min;
  json[prefix + "max_" + unit] = s.max;
}

std::string lines(const std::string& name, const Statistics& s, const std::string& unit) {
  std::string text;
  const std::pair<const char*, double> values[] = {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median},
                                                   {"std", s.std},   {"min", s.min},   {"max", s.max}};
  for (const auto& [what, value] : values) text += fmt::format("{}.{} {:.6f} {}\n", name, what, value, unit);
  return text;
}

Json summary_json(const DistanceSummary& s) {
  Json json;
  put(json, "", s.distance_m, "m");
  json["within_1cm"] = s.within_1cm;
  json["within_2cm"] = s.within_2cm;
  json["within_5cm"] = s.within_5cm;
  json["ghosts"] = s.ghosts;
  json["curve"] = s.curve;
  return json;
}

}  // namespace

std::string ate_text(const AteResult& r) {
  return fmt::format(
             "compared_pose_pairs {} pairs\nmatched_share {:.4f} of the estimate's {} poses, {:.4f} of the "
             "truth's {}\n",
             r.pairs.size(), r.matched_share_estimate(), r.estimate_poses, r.matched_share_truth(),
             r.truth_poses) +
         lines("absolute_translational_error", r.translation_m, "m");
}

std::string ate_json(const AteResult& r) {
  Json json;
  json["pairs"] = r.pairs.size();
  json["estimate_poses"] = r.estimate_poses;
  json["truth_poses"] = r.truth_poses;
  json["matched_share"] = r.matched_share_estimate();
  json["matched_share_truth"] = r.matched_share_truth();
  put(json, "", r.translation_m, "m");
  const Vec3d t = r.T_truth_estimate.translation;
  const Quatd q = quaternion_from(r.T_truth_estimate.rotation);
  json["T_truth_estimate"] = {t.x, t.y, t.z, q.x, q.y, q.z, q.w};
  return json.dump(2) + "\n";
}

std::string rpe_text(const RpeResult& r, double delta_s) {
  return fmt::format("compared_pose_pairs {} pairs\ndelta {} s\n", r.samples.size(), delta_s) +
         lines("translational_error", r.translation_m, "m") +
         lines("rotational_error", r.rotation_deg, "deg");
}

std::string rpe_json(const RpeResult& r, double delta_s) {
  Json json;
  json["pairs"] = r.samples.size();
  json["estimate_poses"] = r.estimate_poses;
  json["truth_poses"] = r.truth_poses;
  json["delta_s"] = delta_s;
  put(json, "trans_", r.translation_m, "m");
  put(json, "rot_", r.rotation_deg, "deg");
  put(json, "trans_eq2_", r.translation_eq2_m, "m");
  return json.dump(2) + "\n";
}

std::string model_text(const ModelResult& r) {
  std::string text =
      fmt::format("vertices {}, truth points {} of {}, measured to a local plane: {:.1f} % of the vertices\n",
                  r.vertices, r.truth_points, r.truth_points_file, 100 * r.on_plane_share);
  const std::pair<const char*, const DistanceSummary*> ways[] = {{"distance to the surface", &r.to_surface},
                                                                 {"to the nearest point", &r.to_point}};
  for (const auto& [name, s] : ways)
    text += fmt::format(
        "{}: within 1 cm {:.2f} %, 2 cm {:.2f} %, 5 cm {:.2f} %; ghosts (over 10 cm) {:.2f} %; mean {:.4f} "
        "m, median {:.4f} m, "
        "rmse {:.4f} m, max {:.4f} m\n",
        name, 100 * s->within_1cm, 100 * s->within_2cm, 100 * s->within_5cm, 100 * s->ghosts,
        s->distance_m.mean, s->distance_m.median, s->distance_m.rmse, s->distance_m.max);
  return r.warning.empty() ? text : text + "warning: " + r.warning + "\n";
}

std::string model_json(const ModelResult& r) {
  Json json = summary_json(r.to_surface);
  json["curve_step_m"] = kCurveStep_m;
  json["to_point"] = summary_json(r.to_point);
  json["vertices"] = r.vertices;
  json["truth_points"] = r.truth_points;
  json["truth_points_file"] = r.truth_points_file;
  json["on_plane_share"] = r.on_plane_share;
  if (!r.warning.empty()) json["warning"] = r.warning;
  return json.dump(2) + "\n";
}

}  // namespace stillmap
