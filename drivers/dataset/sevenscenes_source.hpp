#pragma once

#include <memory>
#include <string>

#include "config/result.hpp"
#include "drivers/dataset/dataset_options.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Opens a folder of frame-NNNNNN.{color.png|color.jpg, depth.png, pose.txt} (7-Scenes). The stamp of a frame
/// is NNNNNN/30 s; numbers may start anywhere and have gaps. pose.txt, where it is a pose, is the truth.
/// Depth has 1000 units in a metre unless camera.toml or the options say otherwise.
/// @return kind cannot_open or bad_usage (intrinsics), one line naming the file
/// @thread boot
Result<std::unique_ptr<FrameSource>> open_sevenscenes(const std::string& dir, const DatasetOptions& options);

/// NNNNNN/30 s to the nearest nanosecond.
/// @param number >= 0
Stamp sevenscenes_stamp(int64_t number);

}  // namespace stillmap
