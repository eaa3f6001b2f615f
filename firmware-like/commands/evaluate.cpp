// stillmap evaluate: trajectories and meshes against their truth, and the paper's tables.

#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "firmware-like/commands/command.hpp"
#include "firmware-like/journal.hpp"
#include "runtime/evaluate/report.hpp"
#include "runtime/evaluate/suite.hpp"
#include "runtime/record/output_file.hpp"

extern char** environ;

namespace stillmap {
namespace {

struct TrajectoryOptions {
  std::string truth, estimate, csv;
  double max_dt_s = 0.02;
  double delta_s = 1.0;
  bool json = false;
};

struct ModelCommandOptions {
  std::string truth, mesh, pose, csv;
  bool json = false;
};

struct SuiteOptions {
  std::string dir, out = "out/suite";
  std::vector<std::string> configs;
};

/// Says what is wrong with it, nothing when it is a time above 0.
std::string positive_seconds(const std::string& text) {
  const std::optional<double> value = parse_number(text);
  return value && *value > 0 ? std::string()
                             : fmt::format("'{}': expected a number of seconds above 0", text);
}

int print(const std::string& text) {
  const bool written =
      std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  return written ? kExitDone : fail("standard output cannot be written", ErrorKind::failed);
}

int write_csv_then_print(const std::string& path, const std::string& csv, const std::string& text) {
  if (!path.empty()) {
    const std::string error = write_whole_file(path, csv);
    if (!error.empty()) return fail(error, ErrorKind::failed);
  }
  return print(text);
}

int evaluate_ate(const TrajectoryOptions& options) {
  const Result<Trajectory> truth = read_trajectory(options.truth);
  if (!truth) return fail(truth.error(), truth.error_kind());
  const Result<Trajectory> estimate = read_trajectory(options.estimate);
  if (!estimate) return fail(estimate.error(), estimate.error_kind());
  const Result<AteResult> ate = absolute_trajectory_error(*truth, *estimate, options.max_dt_s);
  if (!ate)
    return fail(fmt::format("{} against {}: {}", options.estimate, options.truth, ate.error()),
                ate.error_kind());
  return print(options.json ? ate_json(*ate) : ate_text(*ate));
}

int evaluate_rpe(const TrajectoryOptions& options) {
  const Result<Trajectory> truth = read_trajectory(options.truth);
  if (!truth) return fail(truth.error(), truth.error_kind());
  const Result<Trajectory> estimate = read_trajectory(options.estimate);
  if (!estimate) return fail(estimate.error(), estimate.error_kind());
  const Result<RpeResult> rpe = relative_pose_error(*truth, *estimate, options.delta_s);
  if (!rpe)
    return fail(fmt::format("{} against {}: {}", options.estimate, options.truth, rpe.error()),
                rpe.error_kind());
  return write_csv_then_print(
      options.csv, rpe_csv(*rpe),
      options.json ? rpe_json(*rpe, options.delta_s) : rpe_text(*rpe, options.delta_s));
}

int evaluate_model_files(const ModelCommandOptions& options) {
  ModelOptions model_options;
  if (!options.pose.empty()) {
    const Result<Se3d> pose = parse_pose(options.pose);
    if (!pose) return fail("--pose: " + pose.error(), ErrorKind::bad_usage);
    model_options.T_truth_mesh = *pose;
  }
  const Result<ModelResult> model = evaluate_model(options.truth, options.mesh, model_options);
  if (!model) return fail(model.error(), model.error_kind());
  return write_csv_then_print(options.csv, model_csv(*model),
                              options.json ? model_json(*model) : model_text(*model));
}

/// Runs this very program on a sequence, so that a run that dies takes no other with it.
Result<std::string> run_sequence(const std::string& sequence, const std::string& config,
                                 const std::string& out) {
  const std::filesystem::path dir =
      std::filesystem::path(out) /
      (config.empty() ? "default" : std::filesystem::path(config).stem().string()) /
      std::filesystem::path(sequence).filename();
  std::error_code code;
  std::filesystem::create_directories(dir, code);
  if (code) return Error{fmt::format("{}: cannot be made: {}", dir.string(), code.message())};
  std::vector<std::string> words = {"stillmap",   "run",     "--source", "tum:" + sequence,  "--out",
                                    dir.string(), "--quiet", "--set",    "record.mesh=false"};
  if (!config.empty()) words.insert(words.end(), {"--config", config});
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int spawned = posix_spawn(&child, "/proc/self/exe", nullptr, nullptr, arguments.data(), environ);
  if (spawned != 0)
    return Error{fmt::format("{}: the run cannot be started: {}", sequence, std::strerror(spawned))};
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return Error{fmt::format("{}: the run was lost: {}", sequence, std::strerror(errno))};
  if (WIFSIGNALED(status))
    return Error{fmt::format("{}: the run ended by signal {}", sequence, WTERMSIG(status))};
  const int exit_code = WEXITSTATUS(status);
  if (exit_code != kExitDone && exit_code != kExitLost)
    return Error{fmt::format("{}: the run ended with exit code {}", sequence, exit_code)};
  if (exit_code == kExitLost) say(Priority::warning, sequence + ": tracking was lost");
  return (dir / "trajectory.txt").string();
}

int evaluate_suite_dir(const SuiteOptions& options) {
  const SuiteRun run = [&](const std::string& sequence, const std::string& config) {
    say(Priority::info, sequence + " with " + (config.empty() ? "default" : config));
    return run_sequence(sequence, config, options.out);
  };
  const Result<SuiteResult> suite = evaluate_suite(options.dir, options.configs, run);
  if (!suite) return fail(suite.error(), suite.error_kind());
  const int printed = print(suite->text);
  return printed == kExitDone && suite->evaluated == 0 ? kExitFailed : printed;
}

void add_ate(CLI::App& evaluate, int& exit_code) {
  CLI::App* command =
      evaluate.add_subcommand("ate", "absolute trajectory error, SE(3) alignment without scale");
  const auto options = std::make_shared<TrajectoryOptions>();
  command->add_option("--truth", options->truth, "true trajectory, TUM format")->required();
  command->add_option("--estimate", options->estimate, "estimated trajectory, TUM format")->required();
  command->add_option("--max-dt", options->max_dt_s, "poses match when their stamps differ by less, s")
      ->check(positive_seconds, "SECONDS")
      ->capture_default_str();
  command->add_flag("--json", options->json, "print JSON");
  command->callback([options, &exit_code] { exit_code = evaluate_ate(*options); });
}

void add_rpe(CLI::App& evaluate, int& exit_code) {
  CLI::App* command = evaluate.add_subcommand("rpe", "relative pose error over a fixed time");
  const auto options = std::make_shared<TrajectoryOptions>();
  command->add_option("--truth", options->truth, "true trajectory, TUM format")->required();
  command->add_option("--estimate", options->estimate, "estimated trajectory, TUM format")->required();
  command->add_option("--delta-s", options->delta_s, "time between the poses of a pair, s")
      ->check(positive_seconds, "SECONDS")
      ->capture_default_str();
  command->add_flag("--json", options->json, "print JSON");
  command->add_option("--csv", options->csv, "write the error over time here: stamp,trans_m,rot_deg");
  command->callback([options, &exit_code] { exit_code = evaluate_rpe(*options); });
}

void add_model(CLI::App& evaluate, int& exit_code) {
  CLI::App* command = evaluate.add_subcommand("model", "distances of a mesh to the true surface");
  const auto options = std::make_shared<ModelCommandOptions>();
  command->add_option("--truth", options->truth, "point cloud of the true static surface, PLY")->required();
  command->add_option("--mesh", options->mesh, "mesh of the run, PLY")->required();
  command->add_option("--pose", options->pose, "T_truth_mesh as X,Y,Z,QX,QY,QZ,QW");
  command->add_flag("--json", options->json, "print JSON");
  command->add_option("--csv", options->csv,
                      "write the cumulative curve here: distance_m,share,share_to_point");
  command->callback([options, &exit_code] { exit_code = evaluate_model_files(*options); });
}

void add_suite(CLI::App& evaluate, int& exit_code) {
  CLI::App* command = evaluate.add_subcommand("suite", "the paper's two tables beside ours");
  const auto options = std::make_shared<SuiteOptions>();
  command->add_option("dir", options->dir, "folder of TUM and Bonn sequences")->required();
  command->add_option("--config", options->configs, "run with this configuration; may be given several times")
      ->allow_extra_args(false);
  command->add_option("--out", options->out, "where the runs go")->capture_default_str();
  command->callback([options, &exit_code] { exit_code = evaluate_suite_dir(*options); });
}

}  // namespace

void add_evaluate(CLI::App& app, int& exit_code) {
  CLI::App* evaluate = app.add_subcommand("evaluate", "compare a run with the truth");
  evaluate->require_subcommand(1);
  add_ate(*evaluate, exit_code);
  add_rpe(*evaluate, exit_code);
  add_model(*evaluate, exit_code);
  add_suite(*evaluate, exit_code);
}

}  // namespace stillmap
