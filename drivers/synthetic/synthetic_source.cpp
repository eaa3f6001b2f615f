#include "drivers/synthetic/synthetic_source.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/synthetic/odometry.hpp"
#include "drivers/synthetic/renderer.hpp"
#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/sensor_model.hpp"
#include "drivers/synthetic/sonar.hpp"
#include "drivers/synthetic/spec.hpp"
#include "kernels/backend/cpu/thread_pool.hpp"

namespace stillmap {

namespace {

constexpr double kFrameRateHz = 30.0;
constexpr float kDepthUnitsPerM = 5000.0f;
constexpr float kXtionFocalPx = 525.0f;  // at 640 columns
constexpr float kXtionColumns = 640.0f;
constexpr float kTruthStepM = 0.01f;

Intrinsics xtion(int32_t width, int32_t height) {
  const float focal = kXtionFocalPx * static_cast<float>(width) / kXtionColumns;
  return {focal, focal, 0.5f * static_cast<float>(width - 1), 0.5f * static_cast<float>(height - 1),
          width, height};
}

class SyntheticSource final : public FrameSource {
 public:
  SyntheticSource(const std::string& text, const synthetic::Spec& spec, int threads)
      : spec_(spec),
        workers_(threads),
        renderer_(xtion(spec.width, spec.height)),
        sensor_(xtion(spec.width, spec.height), kDepthUnitsPerM, spec.seed),
        odometry_(*spec.scene, spec.seed, spec.wheels_slip) {
    info_.name = "synthetic:" + text;
    info_.camera.k = xtion(spec.width, spec.height);
    info_.depth_units_per_m = kDepthUnitsPerM;
    info_.frames = std::max<int64_t>(1, std::llround(spec.seconds * kFrameRateHz));
    info_.has_truth_mask = true;
  }

  const SourceInfo& info() const override { return info_; }

  Status next(RgbdFrame& frame, int32_t) override {
    if (next_ >= info_.frames) return Status::end;
    const auto index = static_cast<uint32_t>(next_++);
    frame.sequence = index;
    frame.depth_stamp = frame.colour_stamp = stamp_of(index);
    if (!fits(frame.depth_raw) || !fits(frame.colour) ||
        (frame.truth_mask.data != nullptr && !fits(frame.truth_mask))) {
      error_ = info_.name + ": the images given to it are not " + std::to_string(spec_.width) + "x" +
               std::to_string(spec_.height) + ", the size that it announced";
      return Status::bad_data;
    }
    const double t_s = seconds_of(index);
    const Se3d T_world_cam = spec_.scene->camera(t_s);
    renderer_.render(synthetic::world_at(*spec_.scene, t_s, spec_.without_movers), T_world_cam, workers_,
                     images_);
    if (spec_.scene->covered != nullptr && spec_.scene->covered(t_s)) synthetic::cover_lens(images_);
    frame.sonar_m = spec_.scene->sonar ? synthetic::sonar_reading_m(images_, info_.camera.k) : 0.0f;
    sensor_.measure(images_, index, t_s, workers_, frame.depth_raw, frame.colour);
    if (frame.truth_mask.data != nullptr) copy_mask(frame.truth_mask);
    frame.truth_T_world_cam = T_world_cam;
    return Status::ok;
  }

  std::vector<Vec3> truth_cloud() const override {
    const double end_s = seconds_of(static_cast<uint32_t>(info_.frames - 1));
    return synthetic::sample_still_surface(synthetic::world_at(*spec_.scene, end_s, spec_.without_movers),
                                           kTruthStepM);
  }

  void skip(uint32_t count) override { next_ = std::min<int64_t>(next_ + count, info_.frames); }

  OdometryPort* odometry() override { return spec_.odometry ? &odometry_ : nullptr; }

  const std::string& error() const override { return error_; }

 private:
  static double seconds_of(uint32_t index) { return static_cast<double>(index) / kFrameRateHz; }
  static Stamp stamp_of(uint32_t index) { return {std::llround(seconds_of(index) * 1e9)}; }

  template <class T>
  bool fits(const ImageView<T>& image) const {
    return image.data != nullptr && image.rows == spec_.height && image.cols == spec_.width &&
           image.pitch >= image.cols;
  }

  void copy_mask(ImageView<uint8_t> out) const {
    const uint8_t* from = images_.mask.data();
    for (int32_t r = 0; r < out.rows; ++r, from += out.cols) std::copy(from, from + out.cols, out.row(r));
  }

  synthetic::Spec spec_;
  SourceInfo info_;
  ThreadPool workers_;
  synthetic::Renderer renderer_;
  synthetic::SensorModel sensor_;
  synthetic::WheelOdometry odometry_;
  synthetic::IdealImages images_;
  std::string error_;
  int64_t next_ = 0;
};

}  // namespace

Result<std::unique_ptr<FrameSource>> open_synthetic(const std::string& spec, int threads) {
  const Result<synthetic::Spec> parsed = synthetic::parse_spec(spec);
  if (!parsed) return Error{parsed.error()};
  return std::unique_ptr<FrameSource>(std::make_unique<SyntheticSource>(spec, *parsed, threads));
}

std::vector<std::string> synthetic_scene_names() {
  std::vector<std::string> names;
  for (const synthetic::Scene& scene : synthetic::all_scenes()) names.emplace_back(scene.name);
  return names;
}

bool synthetic_scene_wants_completion(const std::string& name) {
  const synthetic::Scene* const scene = synthetic::find_scene(name);
  return scene != nullptr && scene->sonar;
}

bool synthetic_scene_moves(const std::string& name) {
  const synthetic::Scene* const scene = synthetic::find_scene(name);
  return scene != nullptr && scene->dynamic;
}

}  // namespace stillmap
