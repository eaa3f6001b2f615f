#include "drivers/camera/calibrated_source.hpp"

#include <algorithm>
#include <utility>

namespace stillmap {

Result<std::unique_ptr<FrameSource>> CalibratedSource::make(std::unique_ptr<FrameSource> source,
                                                            const DepthBias& depth_bias,
                                                            std::optional<DepthCamera> depth_camera) {
  std::unique_ptr<CalibratedSource> made(new CalibratedSource(std::move(source)));
  SourceInfo& info = made->info_;
  info.depth_bias = depth_bias;
  info.depth_camera.reset();
  if (!depth_camera) return std::unique_ptr<FrameSource>(std::move(made));
  // Depth comes in images of the size of colour; a calibration that says another one is for another camera.
  Intrinsics& k = depth_camera->model.k;
  const Intrinsics& images = info.camera.k;
  if (k.width == 0) k.width = images.width, k.height = images.height;
  if (k.width != images.width || k.height != images.height)
    return Error{info.name + ": the calibration's [depth] is for " + std::to_string(k.width) + "x" +
                     std::to_string(k.height) + " pixels, the images have " + std::to_string(images.width) +
                     "x" + std::to_string(images.height),
                 ErrorKind::bad_usage};
  made->registration_.emplace(*depth_camera, info.camera, info.depth_units_per_m);
  made->depth_.resize(static_cast<size_t>(k.width) * static_cast<size_t>(k.height));
  info.registration_bytes = registration_bytes(k.height, k.width);
  return std::unique_ptr<FrameSource>(std::move(made));
}

Status CalibratedSource::next(RgbdFrame& frame, int32_t timeout_ms) {
  const Status status = next_unfinished(frame, timeout_ms);
  if (status == Status::ok) finish(frame);
  return status;
}

void CalibratedSource::finish(RgbdFrame& frame) {
  source_->finish(frame);
  if (!registration_) return;
  const ImageView<uint16_t> depth_raw{depth_.data(), registration_->depth_rows(), registration_->depth_cols(),
                                      registration_->depth_cols()};
  for (int32_t row = 0; row < depth_raw.rows; ++row)
    std::copy_n(frame.depth_raw.row(row), depth_raw.cols, depth_raw.row(row));
  registration_->run(depth_raw, frame.depth_raw);
}

}  // namespace stillmap
