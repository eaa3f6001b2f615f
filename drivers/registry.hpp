#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/camera/camera_options.hpp"
#include "drivers/dataset/dataset_options.hpp"
#include "drivers/openni2/openni2_source.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

struct SourceOptions {
  DatasetOptions dataset;  ///< for recordings
  CameraOptions camera;    ///< for cameras, and recordings of theirs
  int threads = 2;         ///< 1..64, of a source that computes its frames, the calling thread included
};

/// The source is a camera: frames come at their own pace.
bool is_camera(const std::string& source);

/// What the driver of `xtion` finds.
/// @return kind bad_usage: this build has no such driver; kind cannot_open: its library does not start
/// @thread boot
Result<std::vector<OpenNi2Camera>> xtion_cameras();

/// Makes the source that `source` names: `SCHEME:REST` as on the command line (--source).
/// @return kind bad_usage: no such scheme, a part that this build lacks, unknown intrinsics, a wrong
/// description of a
///         scene; kind cannot_open: the source is not there or cannot be read
/// @thread boot
Result<std::unique_ptr<FrameSource>> open_source(const std::string& source, const SourceOptions& options);

}  // namespace stillmap
