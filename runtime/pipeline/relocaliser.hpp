#pragma once

// Finds the camera again after tracking was lost. A false answer is worse than none: a pose must fit the map
// in several frames before it is believed.

#include <cstdint>
#include <optional>

#include "kernels/engine.hpp"
#include "kernels/params.hpp"

namespace stillmap {

/// @thread real-time thread; allocates nothing
class Relocaliser {
 public:
  Relocaliser(Engine& engine, const RelocaliseParams& params) : engine_(&engine), params_(params) {}

  bool enabled() const { return params_.enabled; }

  /// After a frame was tracked well and integrated: it may become a keyframe.
  void remember(const Se3d& T_map_cam);

  /// For each usable frame while lost, after `prepare`.                         test: pipeline_test
  /// @param T_map_cam_last where the camera was when it was lost; tried first
  /// An attempt for which parts of the map have to come from the archive is made again until they are there.
  /// @return the pose of this frame once it is believed
  std::optional<Se3d> find(const Se3d& T_map_cam_last);

  /// The map was given up, and its keyframes with it.
  void forget() { *this = Relocaliser(*engine_, params_); }

  /// The last answer of the engine.
  const PlaceResult& last() const { return last_; }

 private:
  Engine* engine_;
  RelocaliseParams params_;
  PlaceResult last_;
  int32_t attempt_ = 0;      ///< since the loss
  int32_t waited_ = 0;       ///< frames that this attempt waited for the archive
  int32_t fitted_ = 0;       ///< frames in a row that fitted
  uint32_t remembered_ = 0;  ///< frames offered as keyframes
};

}  // namespace stillmap
