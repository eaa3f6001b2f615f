#pragma once

// The figures of `stillmap bench accuracy`: of one run, and of all runs of a scene.

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/evaluate/statistics.hpp"

namespace stillmap {

/// Which end of several runs is the worst one.
enum class Worst : uint8_t { highest, lowest };

/// What one run came to; NaN: unknown (a recording has no true mask). Counts are whole numbers.
struct AccuracyFigures {
  double frames = kUnknown, lost_frames = kUnknown;
  double ate_rmse_m = kUnknown;                           ///< SE(3) alignment
  double ate_to_twin = kUnknown;                          ///< over that of the static twin with the same seed
  double rpe_rmse_m = kUnknown, rpe_rmse_deg = kUnknown;  ///< over one second
  double mask_iou = kUnknown, static_masked = kUnknown, still_masked = kUnknown;  ///< see MaskScore
  double undeclared_loss = kUnknown, declared_loss = kUnknown;                    ///< frames, see PoseCounts
  double good = kUnknown, good_off = kUnknown;                                    ///< frames
  double in_view = kUnknown, in_view_good = kUnknown;                             ///< frames
  double chi2_frames = kUnknown, chi2_inside = kUnknown;                          ///< frames
  double within_2cm = kUnknown;    ///< share of the mesh's vertices that near to the true surface
  double ghosts = kUnknown;        ///< share of vertices farther than 10 cm
  double completeness = kUnknown;  ///< share of the surface seen for a second that is there within 2 cm
  double end_error_m = kUnknown, path_m = kUnknown;  ///< of the last pose, the first one aligned; true path
  double masked_fraction_mean = kUnknown;            ///< of all pixels
  double total_ms_p50 = kUnknown;

  /// Calls `f(name, member, worst)` for each, in the order of the files.
  template <class F>
  static void fields(F&& f) {
    using P = AccuracyFigures;
    f("frames", &P::frames, Worst::lowest);
    f("lost_frames", &P::lost_frames, Worst::highest);
    f("ate_rmse_m", &P::ate_rmse_m, Worst::highest);
    f("ate_to_twin", &P::ate_to_twin, Worst::highest);
    f("rpe_rmse_m", &P::rpe_rmse_m, Worst::highest);
    f("rpe_rmse_deg", &P::rpe_rmse_deg, Worst::highest);
    f("mask_iou", &P::mask_iou, Worst::lowest);
    f("static_masked", &P::static_masked, Worst::highest);
    f("still_masked", &P::still_masked, Worst::highest);
    f("undeclared_loss", &P::undeclared_loss, Worst::highest);
    f("declared_loss", &P::declared_loss, Worst::highest);
    f("good", &P::good, Worst::lowest);
    f("good_off", &P::good_off, Worst::highest);
    f("in_view", &P::in_view, Worst::lowest);
    f("in_view_good", &P::in_view_good, Worst::lowest);
    f("chi2_frames", &P::chi2_frames, Worst::lowest);
    f("chi2_inside", &P::chi2_inside, Worst::lowest);
    f("within_2cm", &P::within_2cm, Worst::lowest);
    f("ghosts", &P::ghosts, Worst::highest);
    f("completeness", &P::completeness, Worst::lowest);
    f("end_error_m", &P::end_error_m, Worst::highest);
    f("path_m", &P::path_m, Worst::lowest);
    f("masked_fraction_mean", &P::masked_fraction_mean, Worst::highest);
    f("total_ms_p50", &P::total_ms_p50, Worst::highest);
  }
};

/// One run on one scene.
struct AccuracyRun {
  std::string source;  ///< as `stillmap run` takes it
  std::string scene;   ///< the same for all seeds of a scene
  std::string twin;    ///< scene of the static twin; empty: none, nothing moves in it or nobody knows
  std::string preset;
  uint64_t seed = 0;
  bool synthetic = false;
  int exit_code = 0;
  std::string error;  ///< empty: the run was done and the figures hold
  AccuracyFigures figures;

  bool dynamic() const { return !twin.empty(); }
};

/// All seeds of a scene with a preset.
struct AccuracySummary {
  std::string scene, preset;
  uint32_t runs = 0, failed = 0;
  AccuracyFigures median, worst;  ///< over the runs that know the figure
};

/// Sets `ate_to_twin` where the run of the twin with the same preset and seed is there.  test: accuracy_test
void relate_to_twins(std::vector<AccuracyRun>& runs);

/// In the order in which scenes and presets first appear.                test: accuracy_test
std::vector<AccuracySummary> summarise(const std::vector<AccuracyRun>& runs);

/// Middle value, of an even number the mean of the middle two; what is NaN does not count. NaN: no value.
double median_of(std::vector<double> values);

}  // namespace stillmap
