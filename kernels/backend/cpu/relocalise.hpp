#pragma once

#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/volume_view.hpp"
#include "kernels/relocalise/align_pass.hpp"
#include "kernels/relocalise/small_view.hpp"

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
  void clear() { count_ = 0; }

  void remember(const PreparedView& frame, const Se3& T_map_cam);
  PlaceResult find(const PreparedView& frame, const VolumeView& map, const Se3& T_map_cam_guess,
                   int32_t attempt, ThreadPool& threads);
  PlaceResult confirm(const PreparedView& frame, const VolumeView& map, const Se3& T_map_cam_start,
                      ThreadPool& threads);

  /// See Engine::write_place and read_place.
  uint32_t write(uint32_t keyframe, View<uint8_t> record) const;
  Status read(View<const uint8_t> record);

  int32_t keyframes() const { return static_cast<int32_t>(count_); }

 private:
  static constexpr int32_t kMaxTries = 9;  ///< relocalise.tries and the guess

  struct Keyframe {
    Se3 T_map_cam;
    float closest = 0;        ///< similarity of the most similar other keyframe ...
    uint32_t closest_to = 0;  ///< ... and which it is
  };
  /// Scratch of one try; tries run side by side.
  struct Try {
    ModelView model;
    View<Rgb8> colour;
    ImageView<float> expected_m, map_luma;
    Se3 T_map_cam;
    ViewCheck check;
  };

  View<const uint8_t> code_of(uint32_t keyframe) const;
  void shrink(const PreparedView& frame);
  void encode();
  void compare_with_keyframes();
  bool shows_something_new(const Se3& T_map_cam) const;
  void insert(uint32_t place, const Se3& T_map_cam);
  void find_closest(uint32_t keyframe);
  uint32_t most_redundant() const;
  uint32_t list_candidates();
  PlaceResult best_of(uint32_t tries, const VolumeView& map, ThreadPool& threads);

  void align_and_check(const VolumeView& map, Try& t) const;
  void cast_model(const VolumeView& map, Try& t) const;
  bool align_to_model(float gate_m, int32_t iterations, Try& t) const;
  bool align_to_map(const VolumeView& map, Try& t) const;
  void check_view(const VolumeView& map, Try& t) const;
  void compare_luma(Try& t) const;

  RelocaliseParams params_;
  float max_m_ = 0;
  int32_t px_ = 1;
  Intrinsics k_[2];      ///< of the small views
  SmallView small_[2];   ///< about 80x60 and 40x30
  View<uint8_t> code_;   ///< of the frame at hand
  View<uint8_t> codes_;  ///< of the keyframes, one after the other
  View<Keyframe> keyframes_;
  View<float> similarity_;  ///< of the frame at hand to each keyframe
  View<uint32_t> order_;    ///< keyframes to try, the most similar first
  Try tries_[kMaxTries];
  uint32_t count_ = 0;
};

}  // namespace stillmap
