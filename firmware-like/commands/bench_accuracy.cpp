#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "firmware-like/commands/accuracy_jobs.hpp"
#include "firmware-like/commands/accuracy_run.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/evaluate/accuracy_bars.hpp"
#include "runtime/evaluate/accuracy_files.hpp"
#include "runtime/evaluate/accuracy_table.hpp"
#include "runtime/picture/accuracy_picture.hpp"
#include "runtime/record/output_file.hpp"

namespace stillmap {
namespace {

constexpr FigureColumn kColumns[] = {{"ATE cm", &AccuracyFigures::ate_rmse_m, 100, 2},
                                     {"IoU %", &AccuracyFigures::mask_iou, 100, 1},
                                     {"false %", &AccuracyFigures::static_masked, 100, 2},
                                     {"undecl", &AccuracyFigures::undeclared_loss, 1, 0},
                                     {"declrd", &AccuracyFigures::declared_loss, 1, 0},
                                     {"lost", &AccuracyFigures::lost_frames, 1, 0},
                                     {"< 2 cm %", &AccuracyFigures::within_2cm, 100, 1},
                                     {"ghosts %", &AccuracyFigures::ghosts, 100, 2},
                                     {"there %", &AccuracyFigures::completeness, 100, 1},
                                     {"masked %", &AccuracyFigures::masked_fraction_mean, 100, 1},
                                     {"ms p50", &AccuracyFigures::total_ms_p50, 1, 1}};

void print_head() {
  fmt::print("{:<34} {:<10} {:>4}", "scene", "preset", "seed");
  for (const FigureColumn& c : kColumns) fmt::print(" {:>8}", c.head);
  fmt::print(" {:>7} {:>7}\n", "chi2 %", "good %");
}

void print_row(const AccuracyRun& run) {
  fmt::print("{:<34} {:<10} {:>4}", run.scene, run.preset, run.seed);
  const AccuracyFigures& f = run.figures;
  if (!run.error.empty()) {
    fmt::print(" {}\n", run.error);
  } else {
    for (const FigureColumn& c : kColumns) fmt::print(" {:>8}", c.text(f));
    fmt::print(" {:>7} {:>7}\n", figure_text(100 * f.chi2_inside / f.chi2_frames, 1),
               figure_text(100 * f.in_view_good / f.in_view, 1));
  }
  std::fflush(stdout);
}

/// Rows are kept as they come: a bench of hours that is stopped leaves what it measured.
std::string write_files(const std::string& out, const std::vector<AccuracyRun>& runs) {
  for (const auto& [name, content] : {std::pair{"/accuracy.csv", accuracy_csv(runs)},
                                      std::pair{"/accuracy.json", accuracy_json(runs) + "\n"},
                                      std::pair{"/accuracy.md", accuracy_markdown(runs)}})
    if (std::string error = write_whole_file(out + name, content); !error.empty()) return error;
  const auto drawn = write_accuracy_pictures(out, runs);
  return drawn ? std::string() : drawn.error();
}

void print_bars(const std::vector<AccuracyRun>& runs) {
  for (const std::string& preset : presets_of(runs)) {
    fmt::print("\n{}\n", preset);
    for (const Bar& bar : judge(runs, preset, yardstick_for(runs, preset)))
      if (bar.verdict != Verdict::unknown)
        fmt::print("  {:<12} {}: {} {} ({}; limit {})\n", to_string(bar.verdict), bar.what,
                   figure_text(bar.value, 2), bar.unit, bar.scene, figure_text(bar.limit, 2));
  }
}

}  // namespace

int bench_accuracy(const BenchOptions& o) {
  catch_stop_signals();
  const auto jobs = accuracy_jobs(o);
  if (!jobs) return fail(jobs.error(), jobs.error_kind());
  std::error_code code;
  std::filesystem::create_directories(o.out, code);
  auto calibration = OutputFile::create(o.out + "/calibration.csv", OutputFile::Kind::stream);
  if (!calibration) return fail(calibration.error(), ErrorKind::failed);
  calibration->write(calibration_csv_head());
  std::vector<AccuracyRun> runs;
  bool all_good = true;
  if (!o.json) print_head();
  for (const AccuracyJob& job : *jobs) {
    if (stop_requested()) break;
    AccuracyOutcome outcome = run_job(job, o.seeds == 1);
    if (stop_requested()) break;  // it was cut short
    if (outcome.run.exit_code == kExitUsage || outcome.run.exit_code == kExitNoSource)
      return outcome.run.exit_code;
    all_good = all_good && outcome.run.error.empty();
    if (!o.json) print_row(outcome.run);
    calibration->write(calibration_csv(outcome.run, outcome.frames));
    runs.push_back(std::move(outcome.run));
    relate_to_twins(runs);
    if (const std::string error = write_files(o.out, runs); !error.empty())
      return fail(error, ErrorKind::failed);
  }
  if (o.json)
    fmt::print("{}\n", accuracy_json(runs));
  else
    print_bars(runs);
  if (!calibration->close()) return fail(calibration->error(), ErrorKind::failed);
  return all_good ? kExitDone : kExitFailed;
}

}  // namespace stillmap
