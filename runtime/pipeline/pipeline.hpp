#pragma once

// One frame after the other, in the order of the paper: prepare, track, mask, refine, integrate.

#include <cstdint>
#include <optional>

#include "config/config.hpp"
#include "kernels/engine.hpp"
#include "runtime/pipeline/motion_predictor.hpp"
#include "runtime/pipeline/pose_quality.hpp"
#include "runtime/pipeline/relocaliser.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Wall time of the steps of one frame. `total`: frame ready to result ready, decoding excluded.
struct StageTimes {
  float prepare_ms = 0, track_ms = 0, mask_ms = 0, refine_ms = 0, integrate_ms = 0, total_ms = 0;
};

/// What is done to a frame when there is no time for all of it.
struct FrameWork {
  bool integrate = true;     ///< false: tracked, but not mapped
  int32_t finest_level = 0;  ///< of both registrations; 0: as configured
  float sonar_m = 0;         ///< what the sonar saw when the frame was taken; 0: nothing, or there is none
  float finish_ms = 0;       ///< that finishing the frame took; part of preparing it
};

/// What is known after a frame. Plain data: it goes through queues.
struct FrameResult {
  Stamp stamp;     ///< depth capture, of the source's clock
  Stamp captured;  ///< the same as CLOCK_MONOTONIC
  uint32_t sequence = 0;
  Status status =
      Status::ok;  ///< bad_data: frame not used (too few valid pixels); pose predicted, map unchanged
  TrackingState state = TrackingState::good;
  float p_good = 0;  ///< probability that the pose is good, 0..1
  float inlier_ratio = 0;
  float masked_fraction = 0;    ///< masked pixels over all pixels
  bool integrated = false;      ///< the map was worked on
  bool odometry_stale = false;  ///< track.prior = "odometry", but there was none for this frame
  Se3d T_map_cam;               ///< predicted pose while lost
  float covariance[21] = {};    ///< upper triangle, x y z rx ry rz, left perturbation
  StageTimes ms;
  MapHealth map;
};

/// Waits for poses: gets each as soon as it is known, before the map is worked on.
/// @thread real-time; neither waits nor allocates
class PoseListener {
 public:
  virtual ~PoseListener() = default;
  /// @param result state, pose, covariance and the times so far; not yet what the map makes of the frame
  virtual void pose_known(const FrameResult& result) = 0;
};

/// Counters over the run.
struct PipelineCounters {
  uint32_t frames = 0;  ///< processed, bad ones included
  uint32_t bad_frames = 0;
  uint32_t lost_frames = 0;          ///< bad ones included
  uint32_t relocalised = 0;          ///< returns from lost
  uint32_t most_visible_blocks = 0;  ///< with voxels, in one frame: the least that map.pool_blocks must hold
  uint32_t new_maps = 0;             ///< started because the camera was not found again
  uint32_t not_mapped =
      0;  ///< frames that waited to be completed when the camera was lost or the map given up
};

/// @thread real-time thread; `process` does not allocate, lock, touch files or throw
class Pipeline {
 public:
  /// @param T_map_cam pose of the first frame (identity unless --initial-pose)
  /// @param odometry used where track.prior asks for it; may be null; outlives the pipeline
  Pipeline(Engine& engine, const Config& config, const Se3d& T_map_cam = {},
           OdometryPort* odometry = nullptr);

  /// The engine holds a map already: the camera is looked for in it before anything is mapped. Where
  /// relocalise.enabled is false it is tracked on from the guess.
  /// @param T_map_cam_guess tried first  @thread boot                          test: pipeline_test
  void start_lost(const Se3d& T_map_cam_guess);

  /// @param listener hears of the pose early; may be null
  FrameResult process(const RgbdFrame& frame, const FrameWork& work = {}, PoseListener* listener = nullptr);

  /// Seconds by the frames' stamps since the camera was found to be lost; 0: it is not.
  double lost_s() const {
    return lost_since_ ? static_cast<double>(stamp_.ns - lost_since_->ns) * 1e-9 : 0.0;
  }
  /// Before the frame that is worked on: a pose that is found in it is the first of a new epoch.
  bool was_lost() const { return lost_; }
  /// Forgets the map; the next usable frame begins another one, where the camera was seen last: the poses go
  /// on, but what was known of before is elsewhere.                                         test:
  /// pipeline_test
  void start_new_map();

  /// After the last frame: maps those that wait to be completed (depth.invalid = complete), so that the map
  /// holds all that was seen. As long as so many integrations.                        test: pipeline_test
  void finish();

  /// Where the map is needed, metres: around the camera, or where a lost one is looked for.
  Vec3 centre_map() const {
    return lost_ && relocaliser_.enabled() ? relocaliser_.last().T_map_wanted.translation
                                           : cast<float>(T_map_cam_).translation;
  }

  const PipelineCounters& counters() const { return counters_; }

 private:
  void announce(const FrameResult& result);
  void integrate(const Se3& T_map_cam, FrameResult& result);
  void map(const Se3& T_map_cam, FrameResult& result);
  void note(const IntegrateResult& integrated);
  void give_up_kept();
  FrameResult start_map(FrameResult result);
  FrameResult track_and_map(FrameResult result);
  TrackResult first_registration(const PosePrior& prior);
  FrameResult find_again(FrameResult result);
  FrameResult go_on_blind(FrameResult result);
  bool blind_too_long(Stamp stamp) const;
  void remember(const FrameResult& result);
  void measure_period(Stamp stamp);

  Engine& engine_;
  Config config_;
  Relocaliser relocaliser_;
  PipelineCounters counters_;
  FrameWork work_;                    ///< of this frame
  PoseListener* listener_ = nullptr;  ///< of this frame
  MotionPredictor predictor_;
  Se3d T_map_cam_;               ///< last pose
  float explained_ = 0;          ///< share of the valid pixels on the map, last first registration
  Stamp stamp_;                  ///< of the last usable frame
  int64_t frame_period_ns_ = 0;  ///< shortest between two usable frames, 0: not known yet
  double mean_period_s_ = 0;     ///< of late, between usable frames; 0: not known yet
  uint32_t mapped_at_once_ = 0;  ///< frames of this map that did not wait to be completed
  bool have_map_ = false;
  bool lost_ = false;
  std::optional<Stamp> lost_since_;
};

}  // namespace stillmap
