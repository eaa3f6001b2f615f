#include "runtime/evaluate/accuracy.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

double worst_of(const std::vector<double>& values, Worst worst) {
  double found = kUnknown;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    found = std::isnan(found) ? v : worst == Worst::highest ? std::max(found, v) : std::min(found, v);
  }
  return found;
}

AccuracySummary summary_of(const std::vector<const AccuracyRun*>& runs) {
  AccuracySummary summary{runs.front()->scene, runs.front()->preset, 0, 0, {}, {}};
  for (const AccuracyRun* run : runs) {
    ++summary.runs;
    summary.failed += !run->error.empty();
  }
  AccuracyFigures::fields([&](const char*, double AccuracyFigures::*figure, Worst worst) {
    std::vector<double> values;
    for (const AccuracyRun* run : runs) values.push_back(run->figures.*figure);
    summary.worst.*figure = worst_of(values, worst);
    summary.median.*figure = median_of(std::move(values));
  });
  return summary;
}

}  // namespace

double median_of(std::vector<double> values) {
  std::erase_if(values, [](double v) { return std::isnan(v); });
  if (values.empty()) return kUnknown;
  std::sort(values.begin(), values.end());
  const size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

void relate_to_twins(std::vector<AccuracyRun>& runs) {
  for (AccuracyRun& run : runs) {
    if (!run.dynamic()) continue;
    for (const AccuracyRun& twin : runs)
      if (twin.scene == run.twin && twin.preset == run.preset && twin.seed == run.seed)
        run.figures.ate_to_twin = run.figures.ate_rmse_m / twin.figures.ate_rmse_m;
  }
}

std::vector<AccuracySummary> summarise(const std::vector<AccuracyRun>& runs) {
  std::vector<AccuracySummary> summaries;
  for (const AccuracyRun& first : runs) {
    const auto same = [&](const auto& other) {
      return other.scene == first.scene && other.preset == first.preset;
    };
    if (std::any_of(summaries.begin(), summaries.end(), same)) continue;
    std::vector<const AccuracyRun*> group;
    for (const AccuracyRun& run : runs)
      if (same(run)) group.push_back(&run);
    summaries.push_back(summary_of(group));
  }
  return summaries;
}

}  // namespace stillmap
