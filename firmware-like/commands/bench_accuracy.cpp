#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drivers/synthetic/synthetic_source.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/run.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/evaluate/ate.hpp"
#include "runtime/evaluate/model.hpp"

namespace stillmap {
namespace {

using Json = nlohmann::ordered_json;

/// What one run on one scene came to; a figure that could not be had is NaN.
struct Score {
  std::string scene, preset, error;
  int exit_code = 0;
  double ate_m = 0, within_2cm = 0, ghosts = 0, masked = 0, total_ms_p50 = 0;
  uint64_t frames = 0, lost_frames = 0;
};

std::string preset_name(const std::string& config) {
  return config.empty() ? "default" : std::filesystem::path(config).stem().string();
}

void read_report(const std::string& path, Score& score) {
  std::ifstream file(path);
  const Json json = Json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) {
    score.error = path + ": cannot be read";
    return;
  }
  score.frames = json.value("frames", uint64_t{0});
  score.lost_frames = json.value("lost_frames", uint64_t{0});
  score.masked = json.value("masked_fraction_mean", 0.0);
  score.total_ms_p50 = json.value("/ms/total/p50"_json_pointer, 0.0);
}

Score score_run(const BenchOptions& o, const std::string& source, const std::string& config) {
  Score score;
  score.scene = source;
  score.preset = preset_name(config);
  RunOptions run_options;
  run_options.source = source;
  run_options.config = config;
  run_options.settings = o.settings;
  run_options.settings.emplace_back("record.keep_previous=0");
  run_options.settings.emplace_back("record.mesh=true");
  std::string folder = source.substr(source.find(':') + 1);
  std::replace(folder.begin(), folder.end(), '/', '_');
  run_options.out = o.out + "/" + score.preset + "/" + folder;
  run_options.quiet = true;
  score.exit_code = run(run_options);
  if (score.exit_code != kExitDone && score.exit_code != kExitLost) {
    score.error = "the run failed";
    return score;
  }
  read_report(run_options.out + "/report.json", score);
  const auto truth = read_trajectory(run_options.out + "/truth.txt");
  const auto estimate = read_trajectory(run_options.out + "/trajectory.txt");
  if (!truth || !estimate) {
    score.error = truth ? estimate.error() : truth.error();
    return score;
  }
  const auto ate = absolute_trajectory_error(*truth, *estimate);
  const auto model = evaluate_model(run_options.out + "/truth_cloud.ply", run_options.out + "/mesh.ply");
  if (!ate || !model) {
    score.error = ate ? model.error() : ate.error();
    return score;
  }
  score.ate_m = ate->translation_m.rmse;
  score.within_2cm = model->to_surface.within_2cm;
  score.ghosts = model->to_surface.ghosts;
  return score;
}

void print_head() {
  fmt::print("{:<28} {:<12} {:>8} {:>9} {:>8} {:>8} {:>6} {:>8}\n", "scene", "preset", "ATE cm", "< 2 cm %",
             "ghosts %", "masked %", "lost", "ms p50");
}

void print_row(const Score& s) {
  const std::string scene = s.scene.substr(s.scene.find(':') + 1);
  if (!s.error.empty())
    fmt::print("{:<28} {:<12} {}\n", scene, s.preset, s.error);
  else
    fmt::print("{:<28} {:<12} {:>8.2f} {:>9.1f} {:>8.2f} {:>8.1f} {:>6} {:>8.1f}\n", scene, s.preset,
               100 * s.ate_m, 100 * s.within_2cm, 100 * s.ghosts, 100 * s.masked, s.lost_frames,
               s.total_ms_p50);
  std::fflush(stdout);
}

Json json_row(const Score& s) {
  Json row = {{"scene", s.scene}, {"preset", s.preset}, {"exit_code", s.exit_code}};
  if (!s.error.empty()) {
    row["error"] = s.error;
    return row;
  }
  row.update({{"frames", s.frames},
              {"lost_frames", s.lost_frames},
              {"ate_rmse_m", s.ate_m},
              {"within_2cm", s.within_2cm},
              {"ghosts", s.ghosts},
              {"masked_fraction_mean", s.masked},
              {"total_ms_p50", s.total_ms_p50}});
  return row;
}

}  // namespace

int bench_accuracy(const BenchOptions& o) {
  catch_stop_signals();
  std::vector<std::string> sources = o.sources;
  if (sources.empty())
    for (const std::string& scene : synthetic_scene_names()) sources.push_back("synthetic:" + scene);
  const std::vector<std::string> configs = o.configs.empty() ? std::vector<std::string>{""} : o.configs;
  Json rows = Json::array();
  bool all_good = true;
  if (!o.json) print_head();
  for (const std::string& source : sources) {
    for (const std::string& config : configs) {
      if (stop_requested()) break;
      const Score score = score_run(o, source, config);
      if (score.exit_code == kExitUsage || score.exit_code == kExitNoSource) return score.exit_code;
      all_good = all_good && score.error.empty();
      if (o.json)
        rows.push_back(json_row(score));
      else
        print_row(score);
    }
  }
  if (o.json) fmt::print("{}\n", rows.dump(2));
  return all_good ? kExitDone : kExitFailed;
}

}  // namespace stillmap
