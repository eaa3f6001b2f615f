#pragma once

// What has to be reached, and whether it was.

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/evaluate/accuracy.hpp"

namespace stillmap {

enum class Verdict : uint8_t {
  passed,       ///< every seed of every scene
  median_only,  ///< the median over the seeds of every scene, but not the worst
  failed,
  unknown  ///< nothing that was run can tell
};
const char* to_string(Verdict verdict);

/// One bar over all the scenes that it is for.
struct Bar {
  std::string what;  ///< with its limit
  std::string unit;  ///< of value and limit
  Verdict verdict = Verdict::unknown;
  uint32_t cases = 0;           ///< runs (or pooled seeds) that were judged
  std::string scene;            ///< where it is met worst
  double value = 0, limit = 0;  ///< there, in the unit; worst seed
};

/// The bars of `preset`; those that compare two presets measure it against `yardstick`. A failed run fails
/// every bar of its scene.                                               test: accuracy_test
std::vector<Bar> judge(const std::vector<AccuracyRun>& runs, const std::string& preset,
                       const std::string& yardstick);

/// Geometric mean of ATE over the dynamic scenes (median of the seeds), metres. NaN: there are none.
double dynamic_mean_m(const std::vector<AccuracyRun>& runs, const std::string& preset);

}  // namespace stillmap
