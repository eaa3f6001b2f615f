#include "firmware-like/commands/snapshots.hpp"

#include <utility>

#include "runtime/image/image_file.hpp"
#include "runtime/record/trajectory_writer.hpp"

namespace stillmap {

Snapshots::Snapshots(std::string folder, Engine& engine, const SourceInfo& source, int64_t frames,
                     int32_t count)
    : folder_(std::move(folder)), engine_(engine), k_(source.camera.k), frames_(frames), count_(count) {
  depth_m_.resize(static_cast<size_t>(k_.width) * static_cast<size_t>(k_.height));
  colour_.resize(depth_m_.size());
}

void Snapshots::see(const RgbdFrame&, const FrameResult& result, const Engine&) {
  if (due() && error_.empty() && result.status != Status::bad_data) take(result);
  ++seen_;
}

/// The last frame is one of them, the first is not: its map is the frame itself.
bool Snapshots::due() const {
  return frames_ > 0 && taken_ < count_ && seen_ + 1 >= (taken_ + 1) * frames_ / count_;
}

void Snapshots::take(const FrameResult& result) {
  ++taken_;
  const ImageView<Rgb8> colour{colour_.data(), k_.height, k_.width, k_.width};
  const ImageView<float> depth_m{depth_m_.data(), k_.height, k_.width, k_.width};
  if (engine_.raycast(cast<float>(result.T_map_cam), k_, depth_m, colour) != Status::ok) return;
  const std::string path = folder_ + "/" + file_stamp(result.stamp);
  for (const auto& written :
       {write_png(path + "_colour.png", engine_.colour_image()),
        write_png_grey(path + "_mask.png", engine_.mask_image()), write_png(path + "_map.png", colour)})
    if (!written && error_.empty()) error_ = written.error() + "; no further snapshots are written";
}

}  // namespace stillmap
