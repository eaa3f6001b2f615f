// The engine of the GPU, whole, on the emulated grid beside the plain loops of the CPU.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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
  for (int i = 0; i < 9; ++i) {
    ASSERT_NO_FATAL_FAILURE(pair.prepare(i));
    ASSERT_NO_FATAL_FAILURE(pair.integrate(i));
    if (i % 3 == 2) {
      ASSERT_NO_FATAL_FAILURE(expect_same_map(*pair.cpu, pair.gpu(), std::to_string(i)));
    }
  }
}
TEST_P(OnGrid, TheBiasOfTheDepthIsTakenOutAlike) {
  for (const float k1 : {0.0f, 0.1f}) {
    EngineParams params = small_params();
    params.camera.distortion.k1 = k1;
    EnginePair plain(params, GetParam());
    params.depth_bias = {{0.02f, 0.99f, 0.003f, -0.0004f}};
    EnginePair biased(params, GetParam());
    plain.prepare(0);
    biased.prepare(0);
    const auto a = biased.cpu->depth_image_m(), b = biased.gpu().depth_image_m(),
               raw = plain.cpu->depth_image_m();
    int32_t valid = 0;
    for (int32_t r = 0; r < a.rows; ++r)
      for (int32_t c = 0; c < a.cols; ++c) {
        ASSERT_EQ(a.at(r, c), b.at(r, c)) << r << " " << c;
        if (raw.at(r, c) == 0) continue;
        ++valid;
        ASSERT_FLOAT_EQ(a.at(r, c), params.depth_bias.corrected(raw.at(r, c), params.depth.max_m));
      }
    EXPECT_GT(valid, 1000);
  }
}

TEST_P(OnGrid, HierarchicalMapIsTheSameToTheBit) {
  expect_same_maps_of_frames(small_params(), GetParam());
}
TEST_P(OnGrid, DenseMapIsTheSameToTheBit) {
  expect_same_maps_of_frames(paper_params(), GetParam());
}

/// Both engines registered, masked, and registered again at the poses of the CPU's.
struct FrameDifference {
  double pose_m = 0, pose_rad = 0, ratio = 0;
  int32_t mask_pixels = 0, masked = 0;
};
void add_pose_difference(const TrackResult& a, const TrackResult& b, FrameDifference& worst) {
  const Se3d off = inverse(cast<double>(a.T_world_cam)) * cast<double>(b.T_world_cam);
  worst.pose_m = std::max(worst.pose_m, norm(off.translation));
  worst.pose_rad = std::max(worst.pose_rad, norm(log_rotation(off.rotation)));
  worst.ratio = std::max(worst.ratio, static_cast<double>(std::fabs(a.inlier_ratio - b.inlier_ratio)));
  worst.ratio = std::max(worst.ratio, static_cast<double>(std::fabs(a.mapped_ratio - b.mapped_ratio)));
}
void add_mask_difference(const EnginePair& pair, Engine& gpu, FrameDifference& worst) {
  const ImageView<const uint8_t> a = pair.cpu->mask_image(), b = gpu.mask_image();
  int32_t different = 0, masked = 0;
  for (int32_t i = 0; i < a.pixels(); ++i) {
    different += a.data[i] != b.data[i];
    masked += a.data[i] != 0;
  }
  worst.mask_pixels = std::max(worst.mask_pixels, different);
  worst.masked = std::max(worst.masked, masked);
}
FrameDifference compare_frames(EnginePair& pair, int frames) {
  FrameDifference worst;
  for (int i = 0; i < frames; ++i) {
    pair.prepare(i);
    Se3 T;
    if (i > 0) {
      PosePrior prior{pose_at(i - 1), {}};
      for (const int32_t k : {0, 6, 11, 15, 18, 20}) prior.information[k] = 100.0f;
      const TrackResult first = pair.cpu->track(pose_at(i - 1), prior);
      add_pose_difference(first, pair.gpu().track(pose_at(i - 1), prior), worst);
      EXPECT_EQ(first.status, Status::ok);
      const MaskResult a = pair.cpu->mask(first.T_world_cam), b = pair.gpu().mask(first.T_world_cam);
      add_mask_difference(pair, pair.gpu(), worst);
      EXPECT_EQ(b.masked_pixels - a.masked_pixels, 0) << i;
      EXPECT_EQ(b.masked_valid_pixels - a.masked_valid_pixels, 0) << i;
      const TrackResult second = pair.cpu->refine(first.T_world_cam, prior);
      const TrackResult other = pair.gpu().refine(first.T_world_cam, prior);
      add_pose_difference(second, other, worst);
      EXPECT_EQ(second.converged, other.converged) << i;
      T = second.T_world_cam;
    }
    pair.cpu->integrate(T);
    pair.gpu().integrate(T);
  }
  return worst;
}
void expect_small(const FrameDifference& worst) {
  EXPECT_LT(worst.pose_m, 1e-5);
  EXPECT_LT(worst.pose_rad, 1e-5);
  EXPECT_LT(worst.ratio, 1e-4);
  EXPECT_EQ(worst.mask_pixels, 0);
  EXPECT_GT(worst.masked, 100);
}
TEST_P(OnGrid, FramesByPartsAreTheSame) {
  EnginePair pair(small_params(), GetParam());
  expect_small(compare_frames(pair, 8));
  expect_same_map(*pair.cpu, pair.gpu(), "after frames");
}
TEST_P(OnGrid, FramesByResidualsAreTheSame) {
  EnginePair pair(paper_params(), GetParam());
  expect_small(compare_frames(pair, 6));
  expect_same_map(*pair.cpu, pair.gpu(), "after frames");
}

/// The whole way of one engine, by its own poses.
std::vector<std::vector<uint8_t>> own_way(LaneOrder order, int frames) {
  const EngineParams params = small_params();
  EmulatedEngine grid(params, order);
  Engine& engine = grid.engine();
  Se3 T;
  for (int i = 0; i < frames; ++i) {
    EXPECT_EQ(engine.prepare(frame_of(view_at(i, params.camera.k))).status, Status::ok);
    if (i > 0) {
      T = engine.track(T, {}).T_world_cam;
      engine.mask(T);
      T = engine.refine(T, {}).T_world_cam;
    }
    engine.integrate(T);
  }
  auto all = records_of(engine);
  const auto* pose = reinterpret_cast<const uint8_t*>(&T);
  all.emplace_back(pose, pose + sizeof T);
  return all;
}
TEST(DeterminismOnGrid, NoOrderOfBlocksAndLanesChangesAByte) {
  const auto expected = own_way(LaneOrder::rising, 6);
  EXPECT_EQ(own_way(LaneOrder::falling, 6), expected);
  EXPECT_EQ(own_way(LaneOrder::shuffled, 6), expected);
}

TEST(MapOnGrid, ViewsMeshAndPointsAreThoseOfTheCpu) {
  EnginePair pair(small_params(), LaneOrder::shuffled);
  for (int i = 0; i < 5; ++i) {
    pair.prepare(i);
    pair.integrate(i);
  }
  MeshRecorder a, b;
  ASSERT_EQ(pair.cpu->extract_mesh(a), Status::ok);
  ASSERT_EQ(pair.gpu().extract_mesh(b), Status::ok);
  ASSERT_GT(a.positions.size(), 500u);
  EXPECT_EQ(a.positions.size(), b.positions.size());
  EXPECT_EQ(a.indices, b.indices);
  EXPECT_EQ(std::memcmp(a.positions.data(), b.positions.data(), a.positions.size() * sizeof(Vec3)), 0);
  EXPECT_EQ(std::memcmp(a.colours.data(), b.colours.data(), a.colours.size() * sizeof(Rgb8)), 0);

  // Larger than the camera: it comes in strips.
  Intrinsics k = corner_camera(400);
  const auto pixels = static_cast<size_t>(k.width * k.height);
  std::vector<float> depths[2] = {std::vector<float>(pixels), std::vector<float>(pixels)};
  std::vector<Rgb8> colours[2] = {std::vector<Rgb8>(pixels), std::vector<Rgb8>(pixels)};
  Engine* const engines[2] = {pair.cpu.get(), &pair.gpu()};
  for (int e = 0; e < 2; ++e)
    ASSERT_EQ(engines[e]->raycast(pose_at(2), k, {depths[e].data(), k.height, k.width, k.width},
                                  {colours[e].data(), k.height, k.width, k.width}),
              Status::ok);
  size_t hits = 0, different = 0;
  for (size_t i = 0; i < pixels; ++i) {
    hits += depths[0][i] > 0;
    different += !(std::fabs(depths[0][i] - depths[1][i]) < 1e-4f);
  }
  EXPECT_GT(hits, pixels / 2);
  EXPECT_LT(different, pixels / 500);  // a strip is a view of its own: rounding

  std::vector<Vec3> points;
  for (int i = 0; i < 20000; ++i)
    points.push_back({-1.0f + 0.0001f * static_cast<float>(i % 17000),
                      0.3f - 0.00004f * static_cast<float>(i), 0.2f + 0.0001f * static_cast<float>(i)});
  std::vector<PointState> states[2] = {std::vector<PointState>(points.size()),
                                       std::vector<PointState>(points.size())};
  const auto count = static_cast<uint32_t>(points.size());
  for (int e = 0; e < 2; ++e) engines[e]->look_up({points.data(), count}, {states[e].data(), count});
  EXPECT_EQ(states[0], states[1]);
  EXPECT_EQ(std::count(states[1].begin(), states[1].end(), PointState::unknown) == 20000, false);
}

/// The CPU also makes groups for blocks that then find no room; nothing is in those.
std::vector<std::vector<uint8_t>> with_blocks(std::vector<std::vector<uint8_t>> records) {
  std::erase_if(records, [](const std::vector<uint8_t>& record) {
    GroupRecordHead head;
    std::memcpy(&head, record.data(), sizeof head);
    return head.uniform_looks == 0 &&
           std::count(head.kind, head.kind + kGroupBlocks, uint8_t{0}) == kGroupBlocks;
  });
  return records;
}

TEST(MapOnGrid, AFullMapDropsTheSameGroups) {
  EngineParams params = small_params();
  params.map.pool_blocks = 340;
  params.map.high_water = 0.85f;
  EnginePair pair(params, LaneOrder::shuffled);
  uint64_t dropped = 0;
  for (int i = 0; i < 8; ++i) {
    pair.prepare(i);
    ASSERT_NO_FATAL_FAILURE(pair.integrate(i));
    dropped = pair.cpu->map_health().dropped_blocks;
  }
  EXPECT_GT(dropped, 0u);
  EXPECT_EQ(with_blocks(records_of(pair.gpu())), with_blocks(records_of(*pair.cpu)));
}

/// Frames with zeros here and there, wide ones too, with masks and one with a hand before the sonar: kept,
/// completed and fused.
TEST_P(OnGrid, KeptFramesAreCompletedAsOnTheCpu) {
  EngineParams params = small_params();
  params.depth.invalid = InvalidDepth::complete;
  params.depth.complete_frames = 4;
  EnginePair pair(params, GetParam());
  NearEcho echo;
  echo.axis_cam = {0, 0, 1};
  echo.cos_half_beam = 0.96f;
  echo.range_m = 0.2f;
  echo.until_m = 0.5f;
  for (int i = 0; i < 9; ++i) {
    CornerView view = view_at(i, pair.k);
    for (size_t n = 0; n < view.depth_raw.size(); ++n) {
      const auto col = static_cast<int>(n % 96), row = static_cast<int>(n / 96);
      if ((n * 7 + static_cast<size_t>(i)) % 11 == 0 || (row < 30 && col > 30 && col < 80 + i))
        view.depth_raw[n] = 0;
    }
    for (Engine* engine : {pair.cpu.get(), &pair.gpu()}) {
      ASSERT_EQ(engine->prepare(frame_of(view)).status, Status::ok);
      if (i == 0) engine->integrate(pose_at(0));
      if (i > 0) engine->mask(pose_at(i));
      ASSERT_EQ(engine->keep_frame(pose_at(i), i == 3 ? echo : NearEcho{}), std::min(i + 1u, 5u));
    }
    if (i < 4) continue;
    const IntegrateResult a = pair.cpu->integrate_kept(0), b = pair.gpu().integrate_kept(0);
    const std::string when = "frame " + std::to_string(i - 4) + ", completed";
    ASSERT_EQ(a.status, b.status) << when;
    ASSERT_EQ(a.visible_blocks, b.visible_blocks) << when;
    expect_same_health(a.map, b.map, when);
    pair.cpu->forget_kept(1);
    pair.gpu().forget_kept(1);
    expect_same_map(*pair.cpu, pair.gpu(), when);
  }
  EXPECT_EQ(pair.gpu().kept_frames(), 4u);
  EXPECT_EQ(pair.gpu().integrate_kept(4).status, Status::unavailable);
  pair.gpu().reset_map();
  EXPECT_EQ(pair.gpu().kept_frames(), 0u);
}

TEST(MapOnGrid, WhatDoesNotFitIsLeftOutInTheSameOrder) {
  for (EngineParams params : {small_params(), paper_params()}) {
    params.map.pool_blocks = 300;
    params.map.high_water = 1.0f;
    EnginePair pair(params, LaneOrder::shuffled);
    pair.prepare(3);
    const IntegrateResult a = pair.cpu->integrate(pose_at(3)), b = pair.gpu().integrate(pose_at(3));
    EXPECT_EQ(a.status, Status::capacity_exhausted);
    EXPECT_EQ(b.status, Status::capacity_exhausted);
    EXPECT_EQ(a.map.blocks, b.map.blocks);
    EXPECT_GT(b.map.pool_empty, 0u);
    const auto expected = with_blocks(records_of(*pair.cpu));
    EXPECT_GT(expected.size(), 3u);
    EXPECT_EQ(with_blocks(records_of(pair.gpu())), expected);
  }
}

TEST(MapOnGrid, GroupsComeAndGoAsOnTheCpu) {
  EnginePair pair(small_params(), LaneOrder::shuffled);
  for (int i = 0; i < 4; ++i) {
    pair.prepare(i);
    pair.integrate(i);
  }
  const auto records = records_of(*pair.cpu);
  std::vector<uint64_t> far[2] = {std::vector<uint64_t>(64), std::vector<uint64_t>(64)};
  Engine* const engines[2] = {pair.cpu.get(), &pair.gpu()};
  const Se3 away = exp(Twist{{0, 0, -0.2f}, {0, 2.5f, 0}});
  for (int e = 0; e < 2; ++e) {
    // Look elsewhere, so that groups are out of view; put some of them away, forget one, bring one back.
    ASSERT_EQ(engines[e]->prepare(frame_of(view_at(1, pair.k))).status, Status::ok);
    engines[e]->integrate(away);
    far[e].resize(engines[e]->farthest_groups({0, 0, 0}, {far[e].data(), 64}, true));
  }
  ASSERT_EQ(far[0], far[1]);
  ASSERT_GT(far[0].size(), 4u);
  for (Engine* engine : engines) {
    for (uint32_t i = 0; i < 4; ++i) engine->put_away(far[0][i], 100 + i);
    engine->forget_group(far[0][1]);
    EXPECT_EQ(engine->map_health().archived_groups, 3u);
    EXPECT_EQ(engine->read_group({records[2].data(), static_cast<uint32_t>(records[2].size())}), Status::ok);
    EXPECT_EQ(engine->read_group({records[2].data(), 100}), Status::bad_data);
  }
  expect_same_map(*pair.cpu, pair.gpu(), "after putting away");
  std::vector<ArchivedGroup> wanted[2];
  for (int e = 0; e < 2; ++e) {
    ASSERT_EQ(engines[e]->prepare(frame_of(view_at(1, pair.k))).status, Status::ok);
    engines[e]->integrate(pose_at(1));
    wanted[e].resize(16);
    wanted[e].resize(engines[e]->wanted_groups({wanted[e].data(), 16}));
  }
  ASSERT_EQ(wanted[0].size(), wanted[1].size());
  EXPECT_GT(wanted[0].size(), 0u);
  for (size_t i = 0; i < wanted[0].size(); ++i) {
    EXPECT_EQ(wanted[0][i].key, wanted[1][i].key);
    EXPECT_EQ(wanted[0][i].entry, wanted[1][i].entry);
    EXPECT_EQ(wanted[0][i].in_view, wanted[1][i].in_view);
  }
  expect_same_map(*pair.cpu, pair.gpu(), "after looking back");
  for (Engine* engine : engines) engine->reset_map();
  EXPECT_EQ(records_of(pair.gpu()).size(), 0u);
  pair.prepare(5);
  pair.integrate(5);
  expect_same_map(*pair.cpu, pair.gpu(), "after a reset");
}

TEST(PlacesOnGrid, ALostCameraIsFoundWhereTheCpuFindsIt) {
  EngineParams params = small_params();
  params.camera.k = corner_camera(320);
  EnginePair pair(params, LaneOrder::rising);
  for (int i = 0; i < 3; ++i) {
    pair.prepare(i);
    pair.integrate(i);
    pair.cpu->remember_place(pose_at(i));
    pair.gpu().remember_place(pose_at(i));
  }
  ASSERT_EQ(pair.cpu->place_count(), pair.gpu().place_count());
  pair.prepare(2);
  const Se3 guess = pose_at(2) * exp(Twist{{0.05f, 0.03f, -0.04f}, {0.02f, 0.05f, 0.01f}});
  const PlaceResult a = pair.cpu->find_place(guess, 0), b = pair.gpu().find_place(guess, 0);
  ASSERT_EQ(a.status, Status::ok);
  ASSERT_EQ(b.status, Status::ok);
  EXPECT_FLOAT_EQ(a.similarity, b.similarity);
  EXPECT_LT(norm(a.T_map_cam.translation - b.T_map_cam.translation), 1e-3f);
  EXPECT_NEAR(a.check.on, b.check.on, 0.01f);
  EXPECT_NEAR(a.check.luma_correlation, b.check.luma_correlation, 0.01f);
  EXPECT_NEAR(a.check.weakest_m, b.check.weakest_m, 1e-3f);
  EXPECT_EQ(pair.gpu().confirm_place(guess).status, Status::ok);
  std::vector<uint8_t> record(8192), other(8192);
  const uint32_t bytes = pair.cpu->write_place(0, {record.data(), 8192});
  ASSERT_GT(bytes, 0u);
  EXPECT_EQ(pair.gpu().write_place(0, {other.data(), 8192}), bytes);
  EXPECT_EQ(record, other);
}

TEST(LostDevice, IsAnsweredAndStays) {
  const EngineParams params = small_params();
  EmulatedEngine grid(params);
  Engine& engine = grid.engine();
  const CornerView view = view_at(0, params.camera.k);
  ASSERT_EQ(engine.prepare(frame_of(view)).status, Status::ok);
  ASSERT_EQ(engine.integrate({}).status, Status::ok);
  grid.device().lose();
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(engine.prepare(frame_of(view)).status, Status::unavailable);
    const Se3 start = exp(Twist{{0.1f, 0, 0}, {}});
    const TrackResult track = engine.track(start, {});
    EXPECT_EQ(track.status, Status::unavailable);
    EXPECT_EQ(track.T_world_cam.translation.x, start.translation.x);
    EXPECT_EQ(engine.mask({}).status, Status::unavailable);
    EXPECT_EQ(engine.refine(start, {}).status, Status::unavailable);
    EXPECT_EQ(engine.integrate({}).status, Status::unavailable);
    MeshRecorder mesh;
    EXPECT_EQ(engine.extract_mesh(mesh), Status::unavailable);
    std::vector<uint64_t> keys(8);
    EXPECT_EQ(engine.list_groups({keys.data(), 8}), 0u);
    const Vec3 point = {0, 0, 1};
    PointState state = PointState::free;
    engine.look_up({&point, 1}, {&state, 1});
    EXPECT_EQ(state, PointState::unknown);
    EXPECT_EQ(engine.find_place({}, 0).status, Status::unavailable);
  }
}

}  // namespace
}  // namespace stillmap
