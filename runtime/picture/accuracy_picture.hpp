#pragma once

// Pictures of `stillmap bench accuracy`.

#include <string>
#include <vector>

#include "config/result.hpp"
#include "runtime/evaluate/accuracy.hpp"

namespace stillmap {

/// Writes DIR/ate.png (bars of each dynamic or static scene, a bar a preset, the static twin's as a line
/// across it) and, where masks were judged, DIR/mask_iou.png. Bars are medians over the seeds, whiskers the
/// worst.
/// @return an error naming the file
Result<Done> write_accuracy_pictures(const std::string& dir, const std::vector<AccuracyRun>& runs);

}  // namespace stillmap
