// The engine of the GPU, whole, on the emulated grid beside the plain loops of the CPU.

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "kernels/backend/cpu/loops.hpp"
#include "kernels/map/group_record.hpp"
#include "tests/support/corner_scene.hpp"
#include "tests/support/emulated_device.hpp"
#include "tests/support/mesh_recorder.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

EngineParams small_params() {
  EngineParams p;
  p.camera.k = corner_camera(96);
  p.depth.min_valid_pixels = 1000;
  p.map.voxel_m = 0.02f;
  p.map.truncation_m = 0.1f;
  p.map.pool_blocks = 12000;
  p.map.mesh_min_weight = 1;
  p.map.mesh_min_surface = 0;
  p.mask.reabsorb_s = 0.2f;
  p.threads = 1;
  return p;
}
/// As the paper has it: every pixel by itself, then the mask from the residuals, and dense free space.
EngineParams paper_params() {
  EngineParams p = small_params();
  p.mask.method = MaskMethod::residual;
  p.mask.flood_depth_ratio = 0.02f;
  p.track.kernel = RobustKernel::huber;
  p.track.trust_noise_m = p.track.trust_area_m = 0;
  p.track.first_finest_level = 0;
  p.map.free_space = FreeSpace::dense;
  return p;
}

/// A camera that moves on and back, before it a box that comes, goes away, and comes again elsewhere.
Se3 pose_at(int i) {
  const float s = 0.02f * static_cast<float>(i % 8 < 4 ? i % 8 : 8 - i % 8);
  return exp(Twist{{s, -0.5f * s, 0.7f * s}, {0.3f * s, 0.5f * s, -0.2f * s}});
}
CornerScene scene_at(int i) {
  CornerScene scene;
  if (i % 6 >= 3) {
    const double x = -0.3 + 0.04 * i;
    scene.box = {{x, -0.2, 0.9}, {x + 0.35, 0.2, 1.0}};
  }
  return scene;
}
CornerView view_at(int i, const Intrinsics& k) {
  return CornerView(scene_at(i), k, cast<double>(pose_at(i)));
}
FrameView frame_of(const CornerView& view) {
  return {view.image(view.depth_raw), view.image(view.colour), 1.0f / 30.0f};
}

/// All that is known of a map, whatever ids its blocks have.
std::vector<std::vector<uint8_t>> records_of(const Engine& engine) {
  std::vector<uint64_t> keys(engine.group_capacity());
  keys.resize(engine.list_groups({keys.data(), static_cast<uint32_t>(keys.size())}));
  std::vector<std::vector<uint8_t>> records;
  std::vector<uint8_t> record(kMaxGroupRecordBytes);
  for (const uint64_t key : keys) {
    const uint32_t bytes = engine.write_group(key, {record.data(), static_cast<uint32_t>(record.size())});
    EXPECT_GT(bytes, 0u);
    records.emplace_back(record.begin(), record.begin() + bytes);
  }
  return records;
}
void expect_same_map(const Engine& a, const Engine& b, const std::string& when) {
  const auto x = records_of(a), y = records_of(b);
  ASSERT_GT(x.size(), 10u) << when;
  ASSERT_EQ(x.size(), y.size()) << when;
  for (size_t i = 0; i < x.size(); ++i)
    ASSERT_EQ(x[i], y[i]) << when << ", group " << i << " of " << x.size();
}
void expect_same_health(const MapHealth& a, const MapHealth& b, const std::string& when) {
  EXPECT_EQ(a.blocks, b.blocks) << when;
  EXPECT_EQ(a.capacity, b.capacity) << when;
  EXPECT_EQ(a.dropped_blocks, b.dropped_blocks) << when;
  EXPECT_EQ(a.archived_groups, b.archived_groups) << when;
  EXPECT_FLOAT_EQ(a.fill, b.fill) << when;
}

struct EnginePair {
  std::unique_ptr<Engine> cpu;
  EmulatedEngine grid;
  Intrinsics k;

  explicit EnginePair(const EngineParams& params, LaneOrder order = LaneOrder::rising)
      : cpu(make_cpu_engine(params, kLoopsBaseline)), grid(params, order), k(params.camera.k) {}
  Engine& gpu() { return grid.engine(); }

  void prepare(int i) {
    const CornerView view = view_at(i, k);
    const PrepareResult a = cpu->prepare(frame_of(view)), b = gpu().prepare(frame_of(view));
    ASSERT_EQ(a.status, b.status);
    ASSERT_EQ(a.valid_pixels, b.valid_pixels);
  }
  void integrate(int i) {
    const IntegrateResult a = cpu->integrate(pose_at(i)), b = gpu().integrate(pose_at(i));
    const std::string when = "frame " + std::to_string(i);
    ASSERT_EQ(a.status, b.status) << when;
    ASSERT_EQ(a.visible_blocks, b.visible_blocks) << when;
    ASSERT_EQ(a.visible_voxel_blocks, b.visible_voxel_blocks) << when;
    expect_same_health(a.map, b.map, when);
  }
};

class OnGrid : public testing::TestWithParam<LaneOrder> {};
INSTANTIATE_TEST_SUITE_P(Orders, OnGrid,
                         testing::Values(LaneOrder::rising, LaneOrder::falling, LaneOrder::shuffled));

void expect_same_maps_of_frames(EngineParams params, LaneOrder order) {
  EnginePair pair(params, order);
  for (int i = 0; i < 12; ++i) {
    ASSERT_NO_FATAL_FAILURE(pair.prepare(i));
    ASSERT_NO_FATAL_FAILURE(pair.integrate(i));
    if (i % 3 == 2) {
      ASSERT_NO_FATAL_FAILURE(expect_same_map(*pair.cpu, pair.gpu(), std::to_string(i)));
    }
  }
}
TEST_P(OnGrid, HierarchicalMapIsTheSameToTheBit) {
  expect_same_maps_of_frames(small_params(), GetParam());
}
TEST_P(OnGrid, DenseMapIsTheSameToTheBit) {
  expect_same_maps_of_frames(paper_params(), GetParam());
}

}  // namespace
}  // namespace stillmap
