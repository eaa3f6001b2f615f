// Frames that wait, completed and fused by the engine of the CPU.

#include "kernels/complete/kept_frames.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "kernels/engine.hpp"
#include "tests/support/corner_scene.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

EngineParams completing_params() {
  EngineParams p;
  p.camera.k = corner_camera(160);
  p.depth.invalid = InvalidDepth::complete;
  p.depth.complete_frames = 3;
  p.depth.min_valid_pixels = 1000;
  p.map.voxel_m = 0.02f;
  p.map.truncation_m = 0.1f;
  p.map.pool_blocks = 12000;
  p.threads = 2;
  return p;
}

Se3 kept_pose(int i) {
  Se3 T;
  T.translation = {0.01f * static_cast<float>(i), 0, 0};
  return T;
}

/// Prepares the corner as frame i sees it, without depth in the columns from `blind_from` on.
void prepare_corner(Engine& engine, int i, int32_t blind_from) {
  CornerView view(CornerScene{}, corner_camera(160), cast<double>(kept_pose(i)));
  for (int32_t r = 0; r < view.k.height; ++r)
    for (int32_t c = blind_from; c < view.k.width; ++c)
      view.depth_raw[static_cast<size_t>(r * view.k.width + c)] = 0;
  ASSERT_EQ(engine.prepare({view.image(view.depth_raw), view.image(view.colour)}).status, Status::ok);
}

PointState state_at(const Engine& engine, Vec3 p) {
  PointState state = PointState::unknown;
  engine.look_up({&p, 1}, {&state, 1});
  return state;
}

/// On the ray of a pixel of frame 0, so far along the optical axis.
Vec3 on_ray(int32_t row, int32_t col, float z_m) {
  return unproject(corner_camera(160), static_cast<float>(col), static_cast<float>(row), z_m);
}

TEST(KeptFrames, MemoryIsTakenOnlyWhereDepthIsCompleted) {
  const auto bytes_of = [](const EngineParams& p) {
    uint64_t bytes = 0;
    const MemoryItems items = plan_cpu_engine(p);
    for (uint32_t i = 0; i < items.count; ++i)
      if (std::string(items.item[i].name) == "completed depth") bytes += items.item[i].bytes;
    return bytes;
  };
  EngineParams p = completing_params();
  const uint64_t pixels = 160 * 120;
  // Depth, colour and mask of one frame more than the model has; the completed depth.
  EXPECT_GE(bytes_of(p), 4 * pixels * 9 + pixels * 4);
  EXPECT_LT(bytes_of(p), 4 * pixels * 9 + pixels * 4 + 3 * pixels * 4 + 100000);
  p.depth.invalid = InvalidDepth::ignore;
  EXPECT_EQ(bytes_of(p), 0u);
  const auto engine = make_cpu_engine(p);
  ASSERT_NE(engine, nullptr);
  prepare_corner(*engine, 0, 160);
  EXPECT_EQ(engine->keep_frame(kept_pose(0), {}), 0u);
  EXPECT_EQ(engine->integrate_kept(0).status, Status::unavailable);
  engine->forget_kept(3);
}

TEST(KeptFrames, TheyWaitInARing) {
  const auto engine = make_cpu_engine(completing_params());
  ASSERT_NE(engine, nullptr);
  EXPECT_EQ(engine->integrate_kept(0).status, Status::unavailable);
  for (int i = 0; i < 6; ++i) {
    prepare_corner(*engine, i, 160);
    EXPECT_EQ(engine->keep_frame(kept_pose(i), {}), std::min(i + 1u, 4u)) << "three and one more";
  }
  EXPECT_EQ(engine->map_health().blocks, 0u) << "nothing was fused";
  engine->forget_kept(1);
  EXPECT_EQ(engine->kept_frames(), 3u);
  EXPECT_EQ(engine->integrate_kept(2).status, Status::ok);
  EXPECT_EQ(engine->integrate_kept(3).status, Status::unavailable);
  EXPECT_EQ(engine->kept_frames(), 3u) << "it stays until it is forgotten";
  EXPECT_GT(engine->map_health().blocks, 0u);
  engine->forget_kept(100);
  EXPECT_EQ(engine->kept_frames(), 0u);
  prepare_corner(*engine, 0, 160);
  engine->keep_frame(kept_pose(0), {});
  engine->reset_map();
  EXPECT_EQ(engine->kept_frames(), 0u);
}

TEST(KeptFrames, WithoutZerosItIsWhatIntegrateDoes) {
  const auto at_once = make_cpu_engine(completing_params()), later = make_cpu_engine(completing_params());
  prepare_corner(*at_once, 0, 160);
  at_once->integrate(kept_pose(0));
  for (int i = 0; i < 4; ++i) {
    prepare_corner(*later, i, 160);
    later->keep_frame(kept_pose(i), {});
  }
  later->integrate_kept(0);
  const MapHealth a = at_once->map_health(), b = later->map_health();
  EXPECT_EQ(a.blocks, b.blocks);
  std::vector<uint64_t> keys(at_once->group_capacity()), others(keys.size());
  keys.resize(at_once->list_groups({keys.data(), static_cast<uint32_t>(keys.size())}));
  others.resize(later->list_groups({others.data(), static_cast<uint32_t>(others.size())}));
  ASSERT_GT(keys.size(), 10u);
  ASSERT_EQ(keys, others);
}

TEST(KeptFrames, ZerosAreFilledAndTheRestIsSeenFree) {
  const auto ignoring = make_cpu_engine(completing_params()),
             completing = make_cpu_engine(completing_params());
  prepare_corner(*ignoring, 0, 60);
  ignoring->integrate(kept_pose(0));
  // The later frames see up to column 100, nobody sees beyond.
  for (int i = 0; i < 4; ++i) {
    prepare_corner(*completing, i, i == 0 ? 60 : 100);
    completing->keep_frame(kept_pose(i), {});
  }
  completing->integrate_kept(0);
  const CornerView truth(CornerScene{}, corner_camera(160), cast<double>(kept_pose(0)));
  const float wall_m = truth.depth_m[60 * 160 + 80], beyond_m = truth.depth_m[60 * 160 + 130];
  const auto wall = on_ray(60, 80, wall_m + 0.02f), before = on_ray(60, 80, wall_m - 0.3f);
  EXPECT_EQ(state_at(*ignoring, wall), PointState::unknown);
  EXPECT_EQ(state_at(*ignoring, before), PointState::unknown);
  EXPECT_EQ(state_at(*completing, wall), PointState::occupied);
  EXPECT_EQ(state_at(*completing, before), PointState::free);
  EXPECT_EQ(state_at(*completing, on_ray(60, 130, 0.5f * beyond_m)), PointState::free);
  EXPECT_EQ(state_at(*completing, on_ray(60, 130, beyond_m + 0.1f)), PointState::free) << "taken as far";
  EXPECT_EQ(state_at(*ignoring, on_ray(60, 130, 0.5f * beyond_m)), PointState::unknown);
}

}  // namespace
}  // namespace stillmap
