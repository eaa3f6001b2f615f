#include "runtime/evaluate/accuracy_table.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "runtime/evaluate/accuracy_bars.hpp"

namespace stillmap {
namespace {

/// Each of the tables: few columns, so that two presets fit side by side.
struct Part {
  const char* title;
  std::vector<FigureColumn> columns;
};

const std::vector<Part>& parts() {
  static const std::vector<Part> all = {{"Trajectories",
                                         {{"ATE cm", &AccuracyFigures::ate_rmse_m, 100, 2},
                                          {"of twin", &AccuracyFigures::ate_to_twin, 1, 2},
                                          {"RPE cm/s", &AccuracyFigures::rpe_rmse_m, 100, 2},
                                          {"off, not said", &AccuracyFigures::undeclared_loss, 1, 0},
                                          {"lost for no reason", &AccuracyFigures::declared_loss, 1, 0},
                                          {"ms", &AccuracyFigures::total_ms_p50, 1, 1}}},
                                        {"Masks and meshes",
                                         {{"mask IoU %", &AccuracyFigures::mask_iou, 100, 1},
                                          {"static masked %", &AccuracyFigures::static_masked, 100, 2},
                                          {"with just put down %", &AccuracyFigures::still_masked, 100, 2},
                                          {"within 2 cm %", &AccuracyFigures::within_2cm, 100, 1},
                                          {"ghosts %", &AccuracyFigures::ghosts, 100, 2},
                                          {"complete %", &AccuracyFigures::completeness, 100, 1}}}};
  return all;
}

std::string cell(const AccuracySummary& s, const FigureColumn& c) {
  const std::string median = c.text(s.median);
  if (s.runs < 2 || std::isnan(s.median.*c.figure)) return median;
  return fmt::format("{} ({})", median, c.text(s.worst));
}

const AccuracySummary* find(const std::vector<AccuracySummary>& all, const std::string& scene,
                            const std::string& preset) {
  for (const AccuracySummary& s : all)
    if (s.scene == scene && s.preset == preset) return &s;
  return nullptr;
}

std::vector<std::string> scenes_of(const std::vector<AccuracyRun>& runs) {
  std::vector<std::string> scenes;
  for (const AccuracyRun& run : runs)
    if (std::find(scenes.begin(), scenes.end(), run.scene) == scenes.end()) scenes.push_back(run.scene);
  return scenes;
}

std::string table(const Part& part, const std::vector<AccuracyRun>& runs,
                  const std::vector<AccuracySummary>& summaries) {
  const std::vector<std::string> presets = presets_of(runs);
  std::string text = fmt::format("### {}\n\n| scene |", part.title), rule = "|---|";
  for (const FigureColumn& c : part.columns)
    for (const std::string& preset : presets) {
      text += fmt::format(" {} {} |", c.head, preset);
      rule += "---|";
    }
  text += "\n" + rule + "\n";
  for (const std::string& scene : scenes_of(runs)) {
    text += fmt::format("| `{}` |", scene);
    for (const FigureColumn& c : part.columns)
      for (const std::string& preset : presets) {
        const AccuracySummary* s = find(summaries, scene, preset);
        text += fmt::format(" {} |", !s ? "-" : s->failed == s->runs ? "failed" : cell(*s, c));
      }
    text += "\n";
  }
  return text + "\n";
}

/// Runs that every preset has: means over different scenes say nothing.
std::vector<AccuracyRun> shared_runs(const std::vector<AccuracyRun>& runs) {
  std::vector<AccuracyRun> shared;
  const std::vector<std::string> presets = presets_of(runs);
  for (const AccuracyRun& run : runs) {
    const auto has_it = [&](const std::string& preset) {
      return std::any_of(runs.begin(), runs.end(), [&](const AccuracyRun& other) {
        return other.preset == preset && other.scene == run.scene && other.seed == run.seed &&
               !std::isnan(other.figures.ate_rmse_m);
      });
    };
    if (std::all_of(presets.begin(), presets.end(), has_it)) shared.push_back(run);
  }
  return shared;
}

std::string means(const std::vector<AccuracyRun>& all_runs) {
  const std::vector<AccuracyRun> runs = shared_runs(all_runs);
  const std::string yardstick = yardstick_of(runs);
  const double yardstick_m = dynamic_mean_m(runs, yardstick);
  if (std::isnan(yardstick_m)) return {};
  std::string text = "Geometric mean of ATE over the dynamic scenes:";
  for (const std::string& preset : presets_of(runs)) {
    const double mean_m = dynamic_mean_m(runs, preset);
    text += fmt::format(" {} {:.2f} cm", preset, 100 * mean_m);
    if (preset != yardstick) text += fmt::format(" ({:.2f} of that of {})", mean_m / yardstick_m, yardstick);
    text += preset == presets_of(runs).back() ? ".\n\n" : ",";
  }
  return text;
}

std::string bars(const std::vector<AccuracyRun>& runs, const std::string& preset,
                 const std::string& yardstick) {
  std::string text = fmt::format("### Bars of `{}`{}\n\n", preset,
                                 yardstick.empty() ? "" : fmt::format(" (yardstick: `{}`)", yardstick));
  text += "| bar | worst at | value | limit | |\n|---|---|---|---|---|\n";
  for (const Bar& bar : judge(runs, preset, yardstick)) {
    if (bar.verdict == Verdict::unknown) {
      text += fmt::format("| {} | - | - | - | {} |\n", bar.what, to_string(bar.verdict));
      continue;
    }
    const int decimals = bar.unit == "frames" ? 0 : 2;
    text += fmt::format("| {} | {} | {} {} | {} {} | {} |\n", bar.what, bar.scene,
                        figure_text(bar.value, decimals), bar.unit, figure_text(bar.limit, decimals),
                        bar.unit, to_string(bar.verdict));
  }
  return text + "\n";
}

}  // namespace

std::string figure_text(double value, int decimals) {
  return std::isnan(value) ? std::string("-") : fmt::format("{:.{}f}", value, decimals);
}

std::vector<std::string> presets_of(const std::vector<AccuracyRun>& runs) {
  std::vector<std::string> presets;
  for (const AccuracyRun& run : runs)
    if (std::find(presets.begin(), presets.end(), run.preset) == presets.end()) presets.push_back(run.preset);
  return presets;
}

std::string yardstick_of(const std::vector<AccuracyRun>& runs) {
  const std::vector<std::string> presets = presets_of(runs);
  if (presets.empty()) return {};
  return std::find(presets.begin(), presets.end(), "paper") != presets.end() ? "paper" : presets.back();
}

std::string yardstick_for(const std::vector<AccuracyRun>& runs, const std::string& preset) {
  const std::string yardstick = yardstick_of(runs);
  return preset == yardstick ? std::string() : yardstick;
}

std::string accuracy_markdown(const std::vector<AccuracyRun>& runs) {
  const std::vector<AccuracySummary> summaries = summarise(runs);
  std::string text = "Median over the seeds, in brackets the worst of them.\n\n";
  for (const Part& part : parts()) text += table(part, runs, summaries);
  text += means(runs);
  for (const std::string& preset : presets_of(runs)) text += bars(runs, preset, yardstick_for(runs, preset));
  return text;
}

}  // namespace stillmap
