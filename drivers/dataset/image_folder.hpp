#pragma once

// What recordings made of image files have in common: a list of frames that is read one after the other.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/dataset/intrinsics.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// One frame of the list, before its images are read.
struct FrameEntry {
  Stamp depth_stamp, colour_stamp;
  std::string depth_path, colour_path;
  std::optional<Se3d> truth_T_world_cam;
  std::string problem;  ///< why the frame is unusable whatever its images hold; empty: it is not
};

/// Reads the images of a list of frames; a bad frame is passed over and said, and does not end the recording.
class ImageFolderSource final : public FrameSource {
 public:
  /// Takes the size of the images from the first depth image that can be read, and marks the frames whose
  /// stamps do not rise: frames are never put into another order.
  /// @param name as in SourceInfo
  /// @return kind cannot_open without a readable depth image, bad_usage when the camera does not fit the
  /// images
  static Result<std::unique_ptr<FrameSource>> open(std::string name, std::vector<FrameEntry> entries,
                                                   const DatasetCamera& camera);

  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  void skip(uint32_t count) override;
  const std::string& error() const override { return error_; }

 private:
  Status passed_over(std::string why);

  SourceInfo info_;
  std::vector<FrameEntry> entries_;
  size_t next_ = 0;
  std::string error_;
};

}  // namespace stillmap
