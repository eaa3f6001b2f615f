#pragma once

// Keyframes, and which of them a lost camera is looked for at. Host code of both engines; what an engine adds
// are the small views of a frame and following a try to its end.

#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/engine.hpp"
#include "kernels/relocalise/pose_try.hpp"
#include "kernels/relocalise/small_view.hpp"

namespace stillmap {

/// Follows tries to their end. A plain function and its context: nothing is allocated.
struct TryFollower {
  void (*run)(void* context, View<PoseTry> tries) = nullptr;
  void* context = nullptr;

  void operator()(View<PoseTry> tries) const { run(context, tries); }
};

/// @param follow called with the tries; lives as long as the follower
template <class Follow>
TryFollower follower(Follow& follow) {
  return {[](void* context, View<PoseTry> tries) { (*static_cast<Follow*>(context))(tries); }, &follow};
}

/// @thread the engine's caller
class PlaceStore {
 public:
  static constexpr int32_t kMaxTries = 9;  ///< relocalise.tries and the guess

  /// Takes the memory from `arena` (which may be only measuring).
  void carve(Arena& arena, const EngineParams& params);
  void clear() { count_ = 0; }

  bool enabled() const { return params_.enabled; }
  const RelocaliseParams& params() const { return params_; }
  /// Pixels along the edge of a cell of view 0.
  int32_t cell_px() const { return px_; }
  /// The small views of the frame at hand, 0: about 80x60, 1: about 40x30. The engine fills them before any
  /// of the calls that follow.
  const SmallView& view(int32_t i) const { return small_[i]; }
  const Intrinsics& view_k(int32_t i) const { return k_[i]; }

  /// Keeps the frame at hand when it shows something new.
  void remember(const Se3& T_map_cam);
  /// See Engine::find_place and confirm_place.
  PlaceResult find(const Se3& T_map_cam_guess, int32_t attempt, const TryFollower& follow);
  PlaceResult confirm(const Se3& T_map_cam_start, const TryFollower& follow);

  /// See Engine::write_place and read_place.
  uint32_t write(uint32_t keyframe, View<uint8_t> record) const;
  Status read(View<const uint8_t> record);

  uint32_t keyframes() const { return count_; }

 private:
  struct Keyframe {
    Se3 T_map_cam;
    float closest = 0;        ///< similarity of the most similar other keyframe ...
    uint32_t closest_to = 0;  ///< ... and which it is
  };

  View<const uint8_t> code_of(uint32_t keyframe) const;
  void encode();
  void compare_with_keyframes();
  bool shows_something_new(const Se3& T_map_cam) const;
  void insert(uint32_t place, const Se3& T_map_cam);
  void find_closest(uint32_t keyframe);
  uint32_t most_redundant() const;
  uint32_t list_candidates();
  PlaceResult best_of(uint32_t tries, const TryFollower& follow);

  RelocaliseParams params_;
  int32_t px_ = 1;
  Intrinsics k_[2];      ///< of the small views
  SmallView small_[2];   ///< about 80x60 and 40x30
  View<uint8_t> code_;   ///< of the frame at hand
  View<uint8_t> codes_;  ///< of the keyframes, one after the other
  View<Keyframe> keyframes_;
  View<float> similarity_;  ///< of the frame at hand to each keyframe
  View<uint32_t> order_;    ///< keyframes to try, the most similar first
  PoseTry tries_[kMaxTries];
  uint32_t count_ = 0;
};

}  // namespace stillmap
