#pragma once

#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/relocalise/align_pass.hpp"
#include "kernels/relocalise/place_store.hpp"

namespace stillmap {

/// The prepared images of a frame.
struct PreparedView {
  ImageView<const float> depth_m;
  ImageView<const LumaChroma> colour;
  ImageView<const uint8_t> mask;  ///< 0: static
};

/// Keyframes, and the search for a lost camera among them. All memory comes from the arena.
/// @thread the engine's caller
class CpuRelocaliser {
 public:
  /// Takes the memory from `arena` (which may be only measuring).
  void carve(Arena& arena, const EngineParams& params);
  void clear() { store_.clear(); }

  void remember(const PreparedView& frame, const Se3& T_map_cam);
  PlaceResult find(const PreparedView& frame, const VolumeView& map, const Se3& T_map_cam_guess,
                   int32_t attempt, ThreadPool& threads);
  PlaceResult confirm(const PreparedView& frame, const VolumeView& map, const Se3& T_map_cam_start,
                      ThreadPool& threads);

  /// See Engine::write_place and read_place.
  uint32_t write(uint32_t keyframe, View<uint8_t> record) const { return store_.write(keyframe, record); }
  Status read(View<const uint8_t> record) { return store_.read(record); }

  int32_t keyframes() const { return static_cast<int32_t>(store_.keyframes()); }

 private:
  /// Scratch of one try; tries run side by side.
  struct Scratch {
    ModelView model;
    View<Rgb8> colour;
    ImageView<float> expected_m, map_luma;
  };

  void shrink(const PreparedView& frame) const;
  void follow(const VolumeView& map, PoseTry& t, Scratch& scratch) const;
  void cast_model(const VolumeView& map, const PoseTry& t, Scratch& scratch) const;
  bool align_to_model(ModelAlignment alignment, const Scratch& scratch, PoseTry& t) const;
  bool align_to_map(const VolumeView& map, PoseTry& t) const;
  void check_view(const VolumeView& map, Scratch& scratch, PoseTry& t) const;

  PlaceStore store_;
  float max_m_ = 0;
  Scratch scratch_[PlaceStore::kMaxTries];
};

}  // namespace stillmap
