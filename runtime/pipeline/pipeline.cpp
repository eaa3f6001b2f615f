#include "runtime/pipeline/pipeline.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace stillmap {
namespace {

/// Adds up the wall time of consecutive steps.
class StopWatch {
 public:
  /// Milliseconds since the last call, or since it was made.
  float lap_ms() {
    const auto now = Clock::now();
    const float ms = std::chrono::duration<float, std::milli>(now - last_).count();
    last_ = now;
    return ms;
  }
  float total_ms() const { return std::chrono::duration<float, std::milli>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

void set_quality(FrameResult& result, const PoseQuality& quality) {
  result.state = quality.state;
  result.p_good = quality.p_good;
}

/// What the engine is told about the pose to come.
PosePrior prior_from(const PredictedPose& expected, const TrackParams& p) {
  PosePrior prior;
  prior.T_world_cam = cast<float>(expected.T_map_cam);
  if (p.prior == MotionPrior::last_pose || p.prior_point_m <= 0) return prior;
  double information[21];
  information_in_map_axes(expected, information);
  for (int i = 0; i < 21; ++i) prior.information[i] = static_cast<float>(information[i]);
  return prior;
}

/// What the sonar said about the frame that is nearer than the camera sees.
NearEcho near_echo(const SonarConfig& sonar, float range_m) {
  NearEcho echo;
  if (!(range_m > 0.0f && range_m < sonar.veto_m)) return echo;
  constexpr float kHalfDegree = 3.14159265f / 360.0f;
  const auto& T = sonar.T_cam_sonar;
  const float x = T[3], y = T[4], z = T[5], w = T[6];
  echo.place_cam = {T[0], T[1], T[2]};
  // The z axis after the rotation.
  echo.axis_cam =
      normalized(Vec3{2.0f * (x * z + w * y), 2.0f * (y * z - w * x), w * w - x * x - y * y + z * z});
  echo.cos_half_beam = std::cos(kHalfDegree * sonar.beam_deg);
  echo.range_m = range_m;
  echo.until_m = sonar.veto_m;
  return echo;
}

}  // namespace

Pipeline::Pipeline(Engine& engine, const Config& config, const Se3d& T_map_cam, OdometryPort* odometry)
    : engine_(engine),
      config_(config),
      relocaliser_(engine, config.relocalise),
      predictor_(config, T_map_cam, odometry),
      T_map_cam_(T_map_cam) {}

void Pipeline::start_lost(const Se3d& T_map_cam_guess) {
  T_map_cam_ = T_map_cam_guess;
  predictor_.restart(stamp_, T_map_cam_guess);
  have_map_ = lost_ = true;
  mapped_at_once_ = UINT32_MAX;  // the map is not young
}

void Pipeline::start_new_map() {
  counters_.not_mapped += engine_.kept_frames();
  engine_.reset_map();
  relocaliser_.forget();
  T_map_cam_ = predictor_.predict(stamp_).T_map_cam;
  predictor_.restart(stamp_, T_map_cam_);
  explained_ = 0;
  have_map_ = lost_ = false;
  mapped_at_once_ = 0;
  lost_since_.reset();
  ++counters_.new_maps;
}

FrameResult Pipeline::process(const RgbdFrame& frame, const FrameWork& work, PoseListener* listener) {
  StopWatch total, watch;
  work_ = work;
  listener_ = listener;
  engine_.limit_finest_level(work.finest_level);
  FrameResult result;
  result.stamp = frame.depth_stamp;
  result.captured = frame.captured;
  result.sequence = frame.sequence;
  result.T_map_cam = T_map_cam_;
  lost_ = lost_ || blind_too_long(frame.depth_stamp);
  result.state = lost_ ? TrackingState::lost : TrackingState::good;

  const PrepareResult prepared =
      engine_.prepare({frame.depth_raw, frame.colour, static_cast<float>(mean_period_s_)});
  result.status = prepared.status;
  result.ms.prepare_ms = work.finish_ms + watch.lap_ms();
  if (prepared.status == Status::ok) {
    if (!have_map_)
      result = start_map(result);
    else
      result = lost_ && relocaliser_.enabled() ? find_again(result) : track_and_map(result);
    if (result.state == TrackingState::good && (config_.pipeline.mapping || result.integrated))
      relocaliser_.remember(result.T_map_cam);
  } else if (!lost_) {
    result = go_on_blind(result);
    announce(result);
  }
  result.map = engine_.map_health();
  result.ms.total_ms = work.finish_ms + total.total_ms();
  remember(result);
  return result;
}

void Pipeline::announce(const FrameResult& result) {
  if (listener_ != nullptr && result.state != TrackingState::lost) listener_->pose_known(result);
}

void Pipeline::note(const IntegrateResult& integrated) {
  counters_.most_visible_blocks = std::max(counters_.most_visible_blocks, integrated.visible_voxel_blocks);
}

void Pipeline::integrate(const Se3& T_map_cam, FrameResult& result) {
  note(engine_.integrate(T_map_cam));
  ++mapped_at_once_;
  result.integrated = true;
}

/// A registered frame into the map; when its depth is to be completed (paper III-E), it waits for
/// depth.complete_frames more and the one that has waited so long goes into the map. The first ones do not
/// wait and are mapped as they were measured, so that there is something to track against.
void Pipeline::map(const Se3& T_map_cam, FrameResult& result) {
  const auto young_frames = static_cast<uint32_t>(config_.depth.complete_frames);
  if (config_.depth.invalid == InvalidDepth::ignore || mapped_at_once_ < young_frames)
    return integrate(T_map_cam, result);
  const uint32_t kept = engine_.keep_frame(T_map_cam, near_echo(config_.sonar, work_.sonar_m));
  if (kept <= young_frames) return;
  note(engine_.integrate_kept(0));
  engine_.forget_kept(1);
  result.integrated = true;
}

/// What was seen right before the camera was lost is not sure enough for the map.
void Pipeline::give_up_kept() {
  const uint32_t kept = engine_.kept_frames();
  counters_.not_mapped += kept;
  engine_.forget_kept(kept);
}

void Pipeline::finish() {
  const uint32_t kept = engine_.kept_frames();
  for (uint32_t i = 0; i < kept; ++i) note(engine_.integrate_kept(i));
  engine_.forget_kept(kept);
}

/// The first frame is the map: it is taken as static. It is mapped at once, as it was measured, so that there
/// is something to track against.
FrameResult Pipeline::start_map(FrameResult result) {
  StopWatch watch;
  result.p_good = 1.0f;
  result.inlier_ratio = 1.0f;
  announce(result);
  integrate(cast<float>(result.T_map_cam), result);
  result.ms.integrate_ms = watch.lap_ms();
  have_map_ = true;
  return result;
}

/// From where the camera is expected; when much less of the picture then lies on the map than in the last
/// frame, from the last pose as well: a camera that turns back suddenly is not where its motion led. From a
/// wrong start whole surfaces can lie where the map has no value, and nothing pulls them back.
TrackResult Pipeline::first_registration(const PosePrior& prior) {
  const auto explained = [](const TrackResult& r) { return r.mapped_ratio * r.inlier_ratio; };
  TrackResult best = engine_.track(prior.T_world_cam, prior);
  if (explained(best) < explained_ - config_.track.second_start_drop) {
    const TrackResult other = engine_.track(cast<float>(T_map_cam_), prior);
    if (explained(other) > explained(best)) best = other;
  }
  explained_ = explained(best);
  return best;
}

/// Paper Fig. 2: initial pose, dynamics from its residuals, refined pose, integration.
FrameResult Pipeline::track_and_map(FrameResult result) {
  StopWatch watch;
  const PredictedPose expected = predictor_.predict(result.stamp);
  result.odometry_stale =
      config_.track.prior == MotionPrior::odometry && expected.from != MotionPrior::odometry;
  const PosePrior prior = prior_from(expected, config_.track);
  const TrackResult initial = first_registration(prior);
  result.ms.track_ms = watch.lap_ms();
  const MaskResult mask = engine_.mask(initial.T_world_cam);
  result.ms.mask_ms = watch.lap_ms();
  // With nothing masked the second registration is the first one gone on with; nothing is left when it has
  // converged.
  const bool go_on =
      mask.masked_valid_pixels > 0 || !initial.converged || config_.track.first_finest_level > 0;
  const TrackResult refined = go_on ? engine_.refine(initial.T_world_cam, prior) : initial;
  result.ms.refine_ms = watch.lap_ms();

  const int32_t pixels = engine_.mask_image().pixels();
  result.masked_fraction = static_cast<float>(mask.masked_pixels) / static_cast<float>(pixels);
  set_quality(result, quality_of(refined, prior.T_world_cam, config_.track));
  result.inlier_ratio = refined.inlier_ratio;
  if (refined.status == Status::ok) {
    std::copy_n(refined.covariance, 21, result.covariance);
    result.T_map_cam = cast<double>(refined.T_world_cam);
  }
  announce(result);
  // A poor pose freezes the map.
  if (result.state == TrackingState::good && work_.integrate && config_.pipeline.mapping)
    map(refined.T_world_cam, result);
  result.ms.integrate_ms = watch.lap_ms();
  return result;
}

/// Without a usable frame the pose is the one that the motion so far leads to expect, while that is sure.
FrameResult Pipeline::go_on_blind(FrameResult result) {
  const PredictedPose expected = predictor_.predict(result.stamp);
  result.T_map_cam = expected.T_map_cam;
  set_quality(result, quality_of_prediction(expected.sigma));
  return result;
}

/// While lost nothing is mapped; a pose that is believed is tracked on from in the same frame.
FrameResult Pipeline::find_again(FrameResult result) {
  StopWatch watch;
  const std::optional<Se3d> found = relocaliser_.find(T_map_cam_);
  if (!found) {
    result.ms.track_ms = watch.lap_ms();
    return result;
  }
  result.T_map_cam = T_map_cam_ = *found;
  predictor_.restart(result.stamp, *found);
  return track_and_map(result);
}

/// Without a usable frame for so long, the camera may be anywhere. Sources that are slow by nature are not
/// blind.
bool Pipeline::blind_too_long(Stamp stamp) const {
  constexpr int64_t kPeriods = 3;
  const int64_t blind_ns = stamp.ns - stamp_.ns;
  return relocaliser_.enabled() && frame_period_ns_ > 0 && blind_ns > kPeriods * frame_period_ns_ &&
         static_cast<double>(blind_ns) * 1e-9 > static_cast<double>(config_.relocalise.blind_s);
}

void Pipeline::remember(const FrameResult& result) {
  ++counters_.frames;
  const bool lost = result.state == TrackingState::lost;
  if (lost) ++counters_.lost_frames;
  if (result.status != Status::ok) {
    ++counters_.bad_frames;
    return;
  }
  if (lost_ && !lost) ++counters_.relocalised;
  // While lost the last pose stays what it was: the time since then tells the predictor enough.
  if (!lost && lost_)
    predictor_.restart(result.stamp, result.T_map_cam);
  else if (!lost)
    predictor_.update(result.stamp, result.T_map_cam);
  if (!lost) lost_since_.reset();
  if (lost && !lost_since_) lost_since_ = result.stamp;
  if (lost) give_up_kept();
  lost_ = lost;
  measure_period(result.stamp);
  stamp_ = result.stamp;
  T_map_cam_ = result.T_map_cam;
}

void Pipeline::measure_period(Stamp stamp) {
  const int64_t period_ns = stamp.ns - stamp_.ns;
  if (counters_.frames - counters_.bad_frames <= 1 || period_ns <= 0) return;
  frame_period_ns_ = frame_period_ns_ > 0 ? std::min(frame_period_ns_, period_ns) : period_ns;
  // A gap is one long period, whatever its length.
  constexpr double kGain = 0.05, kLongest = 4.0;
  const double period_s = static_cast<double>(period_ns) * 1e-9;
  mean_period_s_ =
      mean_period_s_ > 0
          ? mean_period_s_ + kGain * (std::min(period_s, kLongest * mean_period_s_) - mean_period_s_)
          : period_s;
}

}  // namespace stillmap
