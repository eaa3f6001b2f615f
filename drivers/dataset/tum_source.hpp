#pragma once

#include <memory>
#include <string>

#include "config/result.hpp"
#include "drivers/dataset/dataset_options.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Opens a folder of the TUM benchmark's layout (Bonn's too). Frames come from `associated.txt` (either order
/// of the columns), else from `depth.txt` and `rgb.txt`, paired by stamp. With a time offset the columns of
/// `associated.txt` are paired anew. `groundtruth.txt`, where present, gives the true pose of each frame.
/// Depth has 5000 units in a metre unless camera.toml or the options say otherwise.
/// @return kind cannot_open or bad_usage (intrinsics), one line naming the file
/// @thread boot
Result<std::unique_ptr<FrameSource>> open_tum(const std::string& dir, const DatasetOptions& options);

}  // namespace stillmap
