#pragma once

#include <chrono>
#include <thread>

#include "kernels/engine.hpp"

namespace stillmap::test {

/// What the steps of an engine take longer, in all. track: a registration at the finest level, shared by the
/// two.
struct EngineDelays {
  double track_ms = 0, integrate_ms = 0;
};

/// An engine that takes its time.
class DelayedEngine final : public Engine {
 public:
  /// Both outlive this.
  DelayedEngine(Engine& engine, const EngineDelays& delays) : engine_(engine), delays_(delays) {}

  PrepareResult prepare(const FrameView& frame) override { return engine_.prepare(frame); }
  TrackResult track(const Se3& T, const PosePrior& prior) override {
    wait(delays_.track_ms);
    return engine_.track(T, prior);
  }
  MaskResult mask(const Se3& T) override { return engine_.mask(T); }
  TrackResult refine(const Se3& T, const PosePrior& prior) override { return engine_.refine(T, prior); }
  void limit_finest_level(int32_t level) override { engine_.limit_finest_level(level); }
  IntegrateResult integrate(const Se3& T) override {
    wait(delays_.integrate_ms);
    return engine_.integrate(T);
  }
  uint32_t keep_frame(const Se3& T, const NearEcho& echo) override { return engine_.keep_frame(T, echo); }
  IntegrateResult integrate_kept(uint32_t index) override {
    wait(delays_.integrate_ms);
    return engine_.integrate_kept(index);
  }
  void forget_kept(uint32_t oldest) override { engine_.forget_kept(oldest); }
  uint32_t kept_frames() const override { return engine_.kept_frames(); }
  void remember_place(const Se3& T) override { engine_.remember_place(T); }
  PlaceResult find_place(const Se3& T, int32_t attempt) override { return engine_.find_place(T, attempt); }
  PlaceResult confirm_place(const Se3& T) override { return engine_.confirm_place(T); }
  Status raycast(const Se3& T, const Intrinsics& k, ImageView<float> depth_m,
                 ImageView<Rgb8> colour) override {
    return engine_.raycast(T, k, depth_m, colour);
  }
  Status extract_mesh(MeshSink& sink) override { return engine_.extract_mesh(sink); }
  void look_up(View<const Vec3> points, View<PointState> states) const override {
    engine_.look_up(points, states);
  }
  uint32_t list_groups(View<uint64_t> keys) const override { return engine_.list_groups(keys); }
  uint32_t write_group(uint64_t key, View<uint8_t> record) const override {
    return engine_.write_group(key, record);
  }
  Status read_group(View<const uint8_t> record) override { return engine_.read_group(record); }
  uint32_t group_capacity() const override { return engine_.group_capacity(); }
  uint32_t place_count() const override { return engine_.place_count(); }
  uint32_t write_place(uint32_t index, View<uint8_t> record) const override {
    return engine_.write_place(index, record);
  }
  Status read_place(View<const uint8_t> record) override { return engine_.read_place(record); }
  uint32_t farthest_groups(Vec3 centre, View<uint64_t> keys, bool near_view_too) override {
    return engine_.farthest_groups(centre, keys, near_view_too);
  }
  void put_away(uint64_t key, uint32_t entry) override { engine_.put_away(key, entry); }
  void forget_group(uint64_t key) override { engine_.forget_group(key); }
  uint32_t wanted_groups(View<ArchivedGroup> groups) const override { return engine_.wanted_groups(groups); }
  ImageView<const uint8_t> mask_image() const override { return engine_.mask_image(); }
  ImageView<const float> depth_image_m() const override { return engine_.depth_image_m(); }
  ImageView<const Rgb8> colour_image() const override { return engine_.colour_image(); }
  MapHealth map_health() const override { return engine_.map_health(); }
  void reset_map() override { engine_.reset_map(); }

 private:
  static void wait(double ms) {
    if (ms > 0) std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(ms));
  }

  Engine& engine_;
  const EngineDelays& delays_;
};

}  // namespace stillmap::test
