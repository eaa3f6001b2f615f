#pragma once

// One function a picture. Each gives a finished page, or says in `missing` what it lacks, or fails.

#include <optional>
#include <string>
#include <variant>

#include "runtime/evaluate/ate.hpp"
#include "runtime/evaluate/trajectory.hpp"
#include "runtime/picture/canvas.hpp"

namespace stillmap {

inline constexpr int kPageWidth_px = 1200;

/// Why a picture cannot be made: an input is not there. No failure.
struct Missing {
  std::string what;
};

using Painted = std::variant<Canvas, Missing, Error>;

/// What several pictures need, read once. Files that are not there are empty; broken ones are errors.
struct RunInputs {
  std::string dir;
  std::string truth_path;  ///< empty: none
  std::optional<Result<Trajectory>> estimate, truth;
  std::optional<Result<AteResult>> ate;  ///< when both trajectories are good

  std::string path(const std::string& name) const { return dir + "/" + name; }
  /// The first of estimate and truth that is broken.
  std::optional<Error> broken() const;
};

/// Seen from above and from the side, in the map frame; truth laid over by the alignment of ATE.
Painted paint_trajectory(const RunInputs& inputs);
/// Error of translation and rotation, and the masked share, over time, with poor and lost frames shaded.
Painted paint_error(const RunInputs& inputs);
/// Frames with the mask drawn over them beside the still map in the same view (the paper's Fig. 1).
Painted paint_frames(const RunInputs& inputs);
/// The paper's figure of cumulative distances.
Painted paint_cumulative(const RunInputs& inputs);
/// Time of the stages over the frames.
Painted paint_timing(const RunInputs& inputs);
/// The mesh from above without its ceiling, and from behind the first camera.
Painted paint_map(const RunInputs& inputs);

}  // namespace stillmap
