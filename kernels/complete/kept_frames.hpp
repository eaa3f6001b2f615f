#pragma once

// The frames that wait to be completed and fused. Host code: the memory is the engine's.

#include <algorithm>
#include <cstdint>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/complete/temporary_model.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/voxel.hpp"

namespace stillmap {

/// A registered frame; what belongs to it stays with it.
struct KeptFrame {
  ImageView<float> depth_m;
  ImageView<LumaChroma> luma_chroma;
  ImageView<uint8_t> mask;
  Se3 T_map_cam;
  NearEcho echo;
};

/// A ring of frames, the oldest first, with what completing one of them takes.
/// @thread one at a time; carve: boot
class KeptFrames {
 public:
  /// Takes nothing unless depth.invalid = complete.
  void carve(Arena& arena, const char* name, const EngineParams& p) {
    if (p.depth.invalid != InvalidDepth::complete) return;
    const int32_t rows = p.camera.k.height, cols = p.camera.k.width;
    capacity_ = static_cast<uint32_t>(std::clamp(p.depth.complete_frames, 1, kMostModelFrames)) + 1;
    for (uint32_t i = 0; i < capacity_; ++i) {
      slot_[i].depth_m = arena.take_image<float>(name, rows, cols);
      slot_[i].luma_chroma = arena.take_image<LumaChroma>(name, rows, cols);
      slot_[i].mask = arena.take_image<uint8_t>(name, rows, cols);
    }
    completed_m_ = arena.take_image<float>(name, rows, cols);
    model_.k = p.camera.k;
    model_.truncation_m = p.map.truncation_m;
    model_.cell_px = start_cell_px(cols);
    model_.cell_rows = (rows + model_.cell_px - 1) / model_.cell_px;
    model_.cell_cols = (cols + model_.cell_px - 1) / model_.cell_px;
    model_.start = arena.take<uint32_t>(name, (capacity_ - 1) * static_cast<uint64_t>(model_.cell_rows) *
                                                  static_cast<uint64_t>(model_.cell_cols));
    silent_ = arena.take_image<uint8_t>(name, model_.cell_rows, model_.cell_cols);
    far_m_ = p.depth.far_m;
  }

  uint32_t count() const { return count_; }
  /// The i-th oldest, i < count().
  KeptFrame& at(uint32_t i) { return slot_[(first_ + i) % capacity_]; }
  const KeptFrame& at(uint32_t i) const { return slot_[(first_ + i) % capacity_]; }
  /// Room for the newest one; when there is none the oldest one goes.
  KeptFrame& add() {
    if (count_ == capacity_) forget(1);
    return at(count_++);
  }
  /// The `oldest` oldest ones.
  void forget(uint32_t oldest) {
    oldest = std::min(oldest, count_);
    if (oldest == 0) return;
    first_ = (first_ + oldest) % capacity_;
    count_ -= oldest;
  }

  /// Its memory, without frames.
  const TemporaryModel& empty_model() const { return model_; }
  /// What completes the i-th oldest from all the others.
  /// @param frames room for kMostModelFrames; @param reached the same memory as the passes reach it
  CompletePass completion_of(uint32_t target, ModelFrame* frames, const ModelFrame* reached) const {
    const KeptFrame& own = at(target);
    const Se3 T_own_map = inverse(own.T_map_cam);
    TemporaryModel model = model_;
    model.frame = reached;
    for (uint32_t i = 0; i < count_; ++i) {
      if (i == target) continue;
      const KeptFrame& other = at(i);
      const Se3 T_own_other = T_own_map * other.T_map_cam;
      frames[model.frames++] = {other.depth_m, other.mask, inverse(T_own_other), T_own_other};
    }
    return {model, own.depth_m, own.mask, completed_m_, silent_, own.echo, far_m_};
  }
  SilentCellPass silent_cells_of(const CompletePass& pass) const {
    return {pass.model, pass.depth_m, silent_, pass.echo};
  }

 private:
  KeptFrame slot_[kMostModelFrames + 1];
  ImageView<float> completed_m_;
  ImageView<uint8_t> silent_;
  TemporaryModel model_;  ///< without frames
  float far_m_ = 0;
  uint32_t capacity_ = 0, first_ = 0, count_ = 0;
};

}  // namespace stillmap
