#pragma once

#include <string>
#include <vector>

#include "runtime/evaluate/accuracy.hpp"

namespace stillmap {

/// @param value NaN: not known
/// @return with so many digits behind the point, "-" for what is not known
std::string figure_text(double value, int decimals);

/// How a table shows one figure.
struct FigureColumn {
  const char* head;  ///< with its unit
  double AccuracyFigures::*figure;
  double scale;  ///< to the unit of the head
  int decimals;

  std::string text(const AccuracyFigures& figures) const {
    return figure_text(scale * (figures.*figure), decimals);
  }
};

/// Presets in the order in which they first appear.
std::vector<std::string> presets_of(const std::vector<AccuracyRun>& runs);

/// The preset that the others are measured against: the one named "paper", else the last.
std::string yardstick_of(const std::vector<AccuracyRun>& runs);

/// The same, but none for the yardstick itself: it holds the bars that stand alone, and no comparison.
std::string yardstick_for(const std::vector<AccuracyRun>& runs, const std::string& preset);

/// Markdown: scenes with median (worst) of every figure for each preset side by side, the geometric means,
/// and the bars of each preset but the yardstick.                            test: accuracy_test
std::string accuracy_markdown(const std::vector<AccuracyRun>& runs);

}  // namespace stillmap
