#pragma once

// Whether what the runtime says about its poses is true: states against errors, covariance against scatter.

#include <array>
#include <cstdint>
#include <optional>

#include "runtime/pipeline/pipeline.hpp"

namespace stillmap {

inline constexpr double kEnoughStatic = 0.25;  ///< with this share of static pixels tracking has to hold
inline constexpr double kChi2Bound = 12.592;   ///< 95 % of chi-square with six degrees of freedom lie below
inline constexpr size_t kMapWindow = 30;       ///< good frames whose mean says where the map lies

/// How much of a frame stands still; NaN: nobody knows.
struct StaticShares {
  double of_valid = 0;  ///< static pixels with valid depth over pixels with valid depth
  double of_view = 0;   ///< static pixels with valid depth over all pixels
};

/// One frame against truth; NaN where unknown.
struct PoseErrors {
  double error_m = 0, error_deg = 0;  ///< of the pose in the map frame, which the first pose aligns
  double chi2 = 0;                    ///< of the error relative to the map, under the reported covariance
  bool off = false;                   ///< beyond kGoodPoseM or kGoodPoseDeg
};

struct PoseCounts {
  uint64_t frames = 0;                        ///< with truth
  uint64_t good = 0, good_off = 0;            ///< frames called good; of these, off
  uint64_t undeclared_loss = 0;               ///< called good or poor, and off
  uint64_t declared_loss = 0;                 ///< called lost though enough of the valid pixels stood still
  uint64_t in_view = 0, in_view_good = 0;     ///< frames with enough valid and static pixels; called good
  uint64_t chi2_frames = 0, chi2_inside = 0;  ///< good frames with a covariance; within the 95 % bound
  double path_m = 0;                          ///< length of the true path
  double end_error_m = 0;                     ///< of the last frame with truth
};

/// Adds frames up.
///
/// What chi2 measures. E = T_map_cam * inverse(true T_map_cam) is the left perturbation of a pose, about the
/// map's origin, as the covariance has it. Most of E is drift: the map under the camera lies wrong, and a
/// frame registered to it perfectly has just that E. The map is the running mean of the frames that were
/// fused into it, so the mean of E over the last kMapWindow good frames is where it lies, and log(E *
/// inverse(mean E)) is the error of the frame relative to the map. It has the scatter of the mean in it as
/// well (1/30 of the variance). The window starts anew after a loss. Errors that last longer than the window
/// are drift by this definition.
class PoseScore {
 public:
  /// @param truth_T_world_cam nothing where unknown: the frame is not judged       test: pose_score_test
  PoseErrors add(const FrameResult& result, const std::optional<Se3d>& truth_T_world_cam,
                 const StaticShares& shares);

  const PoseCounts& counts() const { return counts_; }
  /// The true world in the map frame: the first mapped frame lies where truth says. Nothing before it.
  const std::optional<Se3d>& T_map_world() const { return T_map_world_; }

 private:
  double error_under_covariance(const FrameResult& result, const Se3d& E);
  void remember(const Se3d& E);

  PoseCounts counts_;
  std::optional<Se3d> T_map_world_;
  std::optional<Vec3d> last_true_position_;
  std::array<Se3d, kMapWindow> window_;
  size_t in_window_ = 0, next_in_window_ = 0;
};

/// x' C^-1 x. @param covariance upper triangle, row by row
/// @return NaN when C is not positive definite                           test: pose_score_test
double chi_square(const Twistd& x, const float (&covariance)[21]);

}  // namespace stillmap
