#pragma once

// Pictures of a run folder: `stillmap picture DIR`.

#include <string>
#include <vector>

#include "config/result.hpp"

namespace stillmap {

struct PictureOptions {
  std::string truth;  ///< true trajectory; empty: DIR/truth.txt, or DIR/groundtruth.txt
};

enum class PictureState { written, skipped, failed };

/// What became of one picture.
struct PictureOutcome {
  std::string name;  ///< trajectory.png and so on
  PictureState state = PictureState::skipped;
  std::string why;  ///< skipped: which input is missing; failed: file and reason
};

/// Makes DIR/pictures/{trajectory,error,frames,cumulative,timing,map}.png, 1200 pixels wide, each from what
/// it needs: trajectory.txt (and truth), states.csv, snapshots/, mesh.ply and truth_cloud.ply, timing.csv,
/// mesh.ply.
/// @return what became of each, or an error when the folder is not there or cannot be written to
Result<std::vector<PictureOutcome>> make_pictures(const std::string& dir, const PictureOptions& options = {});

}  // namespace stillmap
