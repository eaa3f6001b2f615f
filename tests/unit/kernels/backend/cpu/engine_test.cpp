#include "kernels/engine.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "kernels/map/group_record.hpp"
#include "kernels/mask/grow_mask.hpp"
#include "tests/support/corner_scene.hpp"
#include "tests/support/corner_states.hpp"
#include "tests/support/mesh_recorder.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

constexpr int32_t kWidth = 160;

EngineParams small_params() {
  EngineParams p;
  p.camera.k = corner_camera(kWidth);
  p.map.voxel_m = 0.02f;
  p.map.truncation_m = 0.1f;
  p.map.pool_blocks = 12000;
  p.map.mesh_min_weight = 1;
  p.map.mesh_min_surface = 0;
  p.threads = 1;
  return p;
}

/// As the paper has it: every pixel by itself, then the mask from the residuals.
EngineParams paper_params() {
  EngineParams p = small_params();
  p.mask.method = MaskMethod::residual;
  p.track.kernel = RobustKernel::huber;
  p.track.trust_noise_m = p.track.trust_area_m = 0;
  p.track.first_finest_level = 0;
  p.map.free_space = FreeSpace::dense;
  return p;
}

FrameView frame_of(const CornerView& view) {
  return {view.image(view.depth_raw), view.image(view.colour)};
}

/// A box whose front the camera at the origin sees from the middle: only its front.
CornerScene with_box() {
  CornerScene scene;
  scene.box = {{-0.25, -0.2, 1.0}, {0.25, 0.2, 1.06}};
  return scene;
}

/// An engine and what it makes of views.
struct Rig {
  std::unique_ptr<Engine> engine;
  float period_s = 0;  ///< told with every frame to be masked

  explicit Rig(const EngineParams& params) : engine(make_cpu_engine(params)) {}

  IntegrateResult add(const CornerView& view, const Se3& T = {}, int times = 1) {
    IntegrateResult result;
    for (int n = 0; n < times; ++n) {
      EXPECT_EQ(engine->prepare(frame_of(view)).status, Status::ok);
      result = engine->integrate(T);
    }
    return result;
  }
  MaskResult mask(const CornerView& view, const Se3& T = {}) {
    FrameView frame = frame_of(view);
    frame.period_s = period_s;
    EXPECT_EQ(engine->prepare(frame).status, Status::ok);
    return engine->mask(T);
  }
  std::vector<float> depth_of_map(const Intrinsics& k, const Se3& T = {}) {
    std::vector<float> depth(static_cast<size_t>(k.width * k.height), -1.0f);
    std::vector<Rgb8> colour(depth.size());
    EXPECT_EQ(engine->raycast(T, k, {depth.data(), k.height, k.width, k.width},
                              {colour.data(), k.height, k.width, k.width}),
              Status::ok);
    return depth;
  }
  MeshRecorder mesh() {
    MeshRecorder recorder;
    EXPECT_EQ(engine->extract_mesh(recorder), Status::ok);
    return recorder;
  }
};

bool same_bytes(const Se3& a, const Se3& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}
template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}
bool same_mesh(const MeshRecorder& a, const MeshRecorder& b) {
  return same_bytes(a.positions, b.positions) && same_bytes(a.colours, b.colours) &&
         same_bytes(a.indices, b.indices);
}

TEST(CpuEngine, PlanIsTheSumOfItsLines) {
  for (const bool distorted : {false, true}) {
    EngineParams p = paper_params();
    if (distorted) p.camera.distortion.k1 = 0.1f;
    const MemoryItems plan = plan_cpu_engine(p);
    uint64_t sum = 0;
    for (uint32_t i = 0; i < plan.count; ++i) sum += plan.item[i].bytes;
    EXPECT_EQ(sum, plan.total_bytes);
    EXPECT_GT(plan.total_bytes, 12000u * sizeof(VoxelBlock));
    EXPECT_NE(make_cpu_engine(p), nullptr);
  }
}

TEST(CpuEngine, AFrameOfTheWrongSizeIsBadData) {
  const Rig rig(paper_params());
  const CornerView small({}, corner_camera(80), {}), right({}, corner_camera(kWidth), {});
  EXPECT_EQ(rig.engine->prepare(frame_of(small)).status, Status::bad_data);
  EXPECT_EQ(rig.engine->prepare({right.image(right.depth_raw), small.image(small.colour)}).status,
            Status::bad_data);
  EXPECT_EQ(rig.engine->prepare({}).status, Status::bad_data);
  EXPECT_EQ(rig.engine->prepare(frame_of(right)).status, Status::ok);
}

TEST(CpuEngine, TooFewValidPixelsAreBadDataAndTouchNothing) {
  Rig rig(paper_params());
  CornerView view({}, corner_camera(kWidth), {});
  rig.add(view);
  const MapHealth before = rig.engine->map_health();
  // 3000 of 640x480 is 187 of 160x120.
  for (size_t i = 186; i < view.depth_raw.size(); ++i) view.depth_raw[i] = i % 2 ? 0 : 65535;
  const PrepareResult bad = rig.engine->prepare(frame_of(view));
  EXPECT_EQ(bad.status, Status::bad_data);
  EXPECT_EQ(bad.valid_pixels, 186);
  EXPECT_EQ(rig.engine->map_health().blocks, before.blocks);
  view.depth_raw[186] = 5000;
  EXPECT_EQ(rig.engine->prepare(frame_of(view)).status, Status::ok);
}

TEST(CpuEngine, DepthImageHasInvalidsAsZeroAndKeepsTheFar) {
  EngineParams p = paper_params();
  p.depth.max_m = 1.5f;
  const Rig rig(p);
  CornerView view({}, corner_camera(kWidth), {});
  view.depth_raw[0] = 0;
  view.depth_raw[1] = 65535;
  view.depth_raw[2] = 499;  // nearer than min_m
  view.depth_raw[3] = 20000;
  const PrepareResult result = rig.engine->prepare(frame_of(view));
  const ImageView<const float> depth = rig.engine->depth_image_m();
  EXPECT_EQ(depth.at(0, 0), 0.0f);
  EXPECT_EQ(depth.at(0, 1), 0.0f);
  EXPECT_EQ(depth.at(0, 2), 0.0f);
  EXPECT_FLOAT_EQ(depth.at(0, 3), 4.0f);
  int32_t in_range = 0;
  for (int32_t i = 0; i < depth.pixels(); ++i) in_range += depth.data[i] > 0 && depth.data[i] <= 1.5f;
  EXPECT_EQ(result.valid_pixels, in_range);
  EXPECT_EQ(rig.engine->mask_image().at(0, 0), 0);
}

TEST(CpuEngine, MapsTheSceneWithinAVoxelAndTracksInIt) {
  Rig rig(paper_params());
  const CornerScene scene;
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView(scene, k, {}), {}, 5);
  const std::vector<float> depth = rig.depth_of_map(k);
  int32_t hits = 0;
  for (int32_t r = 2; r < k.height - 2; ++r)
    for (int32_t c = 2; c < k.width - 2; ++c) {
      const float z_m = depth[static_cast<size_t>(r * k.width + c)];
      hits += z_m > 0 && std::fabs(static_cast<double>(z_m) - scene.depth_m(k, {}, c, r)) < 0.02;
    }
  EXPECT_GT(hits, 0.97 * (k.height - 4) * (k.width - 4));

  const Se3d T_truth = exp(Twistd{{0.015, -0.01, 0.01}, {0.01, 0.012, -0.01}});
  const CornerView moved(scene, k, T_truth);
  ASSERT_EQ(rig.engine->prepare(frame_of(moved)).status, Status::ok);
  const TrackResult track = rig.engine->track({});
  EXPECT_EQ(track.status, Status::ok);
  const Se3d off = inverse(T_truth) * cast<double>(track.T_world_cam);
  EXPECT_LT(norm(off.translation), 0.004);
  EXPECT_LT(norm(log_rotation(off.rotation)), 0.004);
  EXPECT_GT(track.inlier_ratio, 0.9f);
  EXPECT_EQ(rig.engine->mask(track.T_world_cam).masked_pixels, 0);
}

TEST(CpuEngine, OfAWidePictureOnlyTheSampledPixelsAreTracked) {
  const Intrinsics k = corner_camera(kWidth);
  const CornerView view({}, k, {});
  CornerView spoiled = view;
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c)
      if (r % 2 == 1 || c % 2 == 1) spoiled.depth_raw[static_cast<size_t>(r * k.width + c)] += 100;  // 2 cm
  Se3 T_start;
  T_start.translation = {0.01f, 0.0f, -0.01f};
  const auto spoils = [&](int32_t sample_cols) {
    EngineParams p = small_params();
    p.mask.enabled = false;
    p.track.sample_cols = sample_cols;
    Rig rig(p);
    rig.add(view, {}, 3);
    const auto tracked = [&](const CornerView& seen) {
      EXPECT_EQ(rig.engine->prepare(frame_of(seen)).status, Status::ok);
      const TrackResult result = rig.engine->refine(T_start);
      EXPECT_EQ(result.status, Status::ok);
      return result.T_world_cam;
    };
    const Se3 T = tracked(view);
    EXPECT_LT(norm(T.translation), 0.003f) << sample_cols;
    return !same_bytes(T, tracked(spoiled));
  };
  EXPECT_FALSE(spoils(kWidth / 2));
  EXPECT_TRUE(spoils(kWidth));
  EXPECT_TRUE(spoils(0));
}

TEST(CpuEngine, TrackingWithoutAMapIsDegenerateAndLeavesThePose) {
  const Rig rig(paper_params());
  ASSERT_EQ(rig.engine->prepare(frame_of(CornerView({}, corner_camera(kWidth), {}))).status, Status::ok);
  const Se3 T_start = exp(Twist{{1, 2, 3}, {0.1f, 0.2f, 0.3f}});
  const TrackResult track = rig.engine->track(T_start);
  EXPECT_EQ(track.status, Status::degenerate);
  EXPECT_TRUE(same_bytes(track.T_world_cam, T_start));
}

// A box comes into what was seen empty: the box, grown by the dilation, and nothing else is masked.
TEST(CpuEngine, ABoxInFreeSpaceIsMaskedExactly) {
  Rig rig(paper_params());
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 3);
  const CornerView view(with_box(), k, {});
  const MaskResult result = rig.mask(view);

  test::TestImage<uint8_t> expected(k.height, k.width), scratch(k.height, k.width);
  std::copy(view.on_box.begin(), view.on_box.end(), expected.view().data);
  const int32_t radius_px = 3;  // 10 px at 640 columns
  dilate_rows(expected.view(), scratch.view(), radius_px, 0, k.height);
  dilate_columns(scratch.view(), expected.view(), radius_px, 0, k.width);
  int32_t wrong = 0, boxed = 0;
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c) {
      wrong += (rig.engine->mask_image().at(r, c) != 0) != (expected.view().at(r, c) != 0);
      boxed += expected.view().at(r, c) != 0;
    }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(boxed, 2000);
  EXPECT_EQ(result.masked_pixels, boxed);
  EXPECT_EQ(result.masked_valid_pixels, boxed);
}

TEST(CpuEngine, ByPartsTheMaskIsTheBoxButForItsRim) {
  Rig rig(small_params());
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 3);
  const CornerView view(with_box(), k, {});
  rig.mask(view);
  test::TestImage<uint8_t> grown(k.height, k.width), scratch(k.height, k.width);
  std::copy(view.on_box.begin(), view.on_box.end(), grown.view().data);
  constexpr int32_t kRimPx = 3;
  dilate_rows(grown.view(), scratch.view(), kRimPx, 0, k.height);
  dilate_columns(scratch.view(), grown.view(), kRimPx, 0, k.width);
  int32_t missed = 0, beyond = 0;
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c) {
      const bool masked = rig.engine->mask_image().at(r, c) != 0;
      missed += !masked && view.on_box[static_cast<size_t>(r * k.width + c)] != 0;
      beyond += masked && !grown.view().at(r, c);
    }
  EXPECT_EQ(missed, 0);
  EXPECT_EQ(beyond, 0);
}

/// Frames of a box that came and stays, until the mask lets go of it.
int32_t frames_until_static(Rig& rig, const CornerView& view, int32_t at_most) {
  for (int32_t n = 0; n < at_most; ++n) {
    if (rig.mask(view).masked_pixels == 0) return n;
    rig.engine->integrate({});
  }
  return at_most;
}

TEST(CpuEngine, ABoxThatCameAndStaysIsStaticAndMapped) {
  EngineParams p = small_params();
  p.mask.reabsorb_s = 0.3f;
  Rig rig(p);
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 20);
  const CornerView view(with_box(), k, {});
  EXPECT_EQ(frames_until_static(rig, view, 40), 9);
  for (int n = 0; n < 8; ++n) {  // and it does not fall back
    EXPECT_EQ(rig.mask(view).masked_pixels, 0) << n;
    rig.engine->integrate({});
  }
  const std::vector<float> depth = rig.depth_of_map(k);
  EXPECT_NEAR(depth[static_cast<size_t>(k.height / 2 * k.width + k.width / 2)], 1.0f, 0.01f);
}

TEST(CpuEngine, WhatHasToLastIsCountedInSeconds) {
  EngineParams p = small_params();
  p.mask.reabsorb_s = 0.6f;
  p.mask.empty_s = 0.4f;
  for (const int32_t frames_a_second : {10, 20, 50}) {
    Rig rig(p);
    rig.period_s = 1.0f / static_cast<float>(frames_a_second);
    const Intrinsics k = corner_camera(kWidth);
    const CornerView empty({}, k, {}), view(with_box(), k, {});
    const int32_t until_empty = frames_a_second * 4 / 10;
    rig.add(empty, {}, until_empty - 1);
    EXPECT_EQ(rig.mask(view).masked_pixels, 0) << "nobody knows yet that it is empty there";
    rig.engine->reset_map();
    rig.add(empty, {}, until_empty);
    EXPECT_EQ(frames_until_static(rig, view, 40), frames_a_second * 6 / 10);
  }
}

TEST(CpuEngine, AMapThatWasForgottenHasNoPastEither) {
  EngineParams p = small_params();
  p.mask.reabsorb_s = 0.3f;
  Rig rig(p);
  const Intrinsics k = corner_camera(kWidth);
  const CornerView empty({}, k, {}), view(with_box(), k, {});
  rig.add(empty, {}, 3);
  for (int n = 0; n < 8; ++n) rig.mask(view);
  rig.engine->reset_map();
  rig.add(empty, {}, 3);
  EXPECT_EQ(frames_until_static(rig, view, 40), 9);  // the eight frames before do not count
}

TEST(CpuEngine, TheWallStaysWhenTheBoxHasGoneThrough) {
  for (const EngineParams& params : {paper_params(), small_params()}) {
    Rig rig(params);
    const Intrinsics k = corner_camera(kWidth);
    const CornerView empty({}, k, {});
    rig.add(empty, {}, 5);
    const MeshRecorder before = rig.mesh();
    for (int n = 0; n < 10; ++n) {
      CornerScene scene = with_box();
      scene.box->low.x += 0.03 * n;
      scene.box->high.x += 0.03 * n;
      rig.mask(CornerView(scene, k, {}));
      rig.engine->integrate({});
    }
    rig.add(empty, {}, 1);
    for (const Vec3& p : rig.mesh().positions) {
      const Vec3d at = {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
      ASSERT_LT(std::fabs(CornerScene{}.sdf_m(at)), 0.02);
    }
    EXPECT_NEAR(static_cast<double>(rig.mesh().positions.size()),
                static_cast<double>(before.positions.size()),
                0.01 * static_cast<double>(before.positions.size()));
  }
}

TEST(CpuEngine, WhatIsMaskedDoesNotChangeTheMap) {
  Rig one(paper_params()), other(paper_params());
  const Intrinsics k = corner_camera(kWidth);
  const CornerView empty({}, k, {});
  one.add(empty, {}, 3);
  other.add(empty, {}, 3);
  // The same pixels are masked in both; what is seen there is not the same.
  CornerView near = empty, far = empty;
  for (int32_t r = 40; r < 80; ++r)
    for (int32_t c = 50; c < 100; ++c) {
      const auto i = static_cast<size_t>(r * k.width + c);
      near.depth_raw[i] = 4000;
      far.depth_raw[i] = 5500;
      near.colour[i] = {255, 0, 0};
    }
  EXPECT_GT(one.mask(near).masked_pixels, 0);
  one.engine->integrate({});
  EXPECT_GT(other.mask(far).masked_pixels, 0);
  other.engine->integrate({});
  EXPECT_TRUE(same_mesh(one.mesh(), other.mesh()));
  EXPECT_TRUE(same_bytes(one.depth_of_map(k), other.depth_of_map(k)));
  EXPECT_EQ(one.engine->map_health().blocks, other.engine->map_health().blocks);
}

TEST(CpuEngine, WhatWasStaticAndIsTakenAwayIsCarved) {
  Rig rig(paper_params());
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView(with_box(), k, {}), {}, 8);
  const auto centre = static_cast<size_t>(k.height / 2 * k.width + k.width / 2);
  EXPECT_NEAR(rig.depth_of_map(k)[centre], 1.0f, 0.01f);
  const CornerView empty({}, k, {});
  for (int n = 0; n < 25; ++n) {
    rig.mask(empty);
    rig.engine->integrate({});
  }
  EXPECT_NEAR(rig.depth_of_map(k)[centre],
              static_cast<float>(CornerScene{}.depth_m(k, {}, k.width / 2, k.height / 2)), 0.01f);
}

TEST(CpuEngine, WithoutFreeSpaceABoxInTheAirIsNotMasked) {
  EngineParams p = paper_params();
  p.integrate.free_space = false;
  Rig with(paper_params()), without(p);
  const Intrinsics k = corner_camera(kWidth);
  with.add(CornerView({}, k, {}), {}, 3);
  without.add(CornerView({}, k, {}), {}, 3);
  EXPECT_LT(2 * without.engine->map_health().blocks, with.engine->map_health().blocks);
  EXPECT_GT(with.mask(CornerView(with_box(), k, {})).masked_pixels, 0);
  EXPECT_EQ(without.mask(CornerView(with_box(), k, {})).masked_pixels, 0);
}

TEST(CpuEngine, FreeSpaceComesFromFarMeasurementsUpToTheClippingPlane) {
  EngineParams p = paper_params();
  p.depth.max_m = 1.5f;  // of the back wall nothing is fused
  p.integrate.free_max_m = 1.2f;
  Rig rig(p);
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 3);
  const auto centre = static_cast<size_t>(k.height / 2 * k.width + k.width / 2);
  EXPECT_EQ(rig.depth_of_map(k)[centre], 0.0f);
  EXPECT_GT(rig.mask(CornerView(with_box(), k, {})).masked_pixels, 0);
  CornerScene behind = with_box();
  behind.box = {{-0.25, -0.2, 1.3}, {0.25, 0.2, 1.36}};
  EXPECT_EQ(rig.mask(CornerView(behind, k, {})).masked_pixels, 0);
}

TEST(CpuEngine, MaskCanBeSwitchedOff) {
  EngineParams p = paper_params();
  p.mask.enabled = false;
  Rig rig(p);
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 3);
  EXPECT_EQ(rig.mask(CornerView(with_box(), k, {})).masked_pixels, 0);
}

TEST(CpuEngine, RefineLooksPastTheMask) {
  Rig rig(paper_params());
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 3);
  rig.mask(CornerView(with_box(), k, {}));
  const TrackResult all = rig.engine->track({}), unmasked = rig.engine->refine({});
  EXPECT_GT(unmasked.inlier_ratio, all.inlier_ratio + 0.05f);
  EXPECT_LT(norm(unmasked.T_world_cam.translation), 0.003f);
}

TEST(CpuEngine, ATinyPoolIsCountedAndFarBlocksAreDropped) {
  EngineParams p = paper_params();
  p.map.pool_blocks = 300;
  Rig rig(p);
  const Intrinsics k = corner_camera(kWidth);
  bool exhausted = false;
  for (int n = 0; n < 12; ++n) {
    const Se3d T = exp(Twistd{{0, 0, -0.05 * n}, {0, 0.1 * n, 0}});
    const IntegrateResult result = rig.add(CornerView({}, k, T), cast<float>(T));
    exhausted |= result.status == Status::capacity_exhausted;
    EXPECT_LE(result.map.blocks, 300u);
    EXPECT_LE(result.visible_blocks, 300u);
    EXPECT_EQ(result.map.blocks, rig.engine->map_health().blocks);
  }
  EXPECT_TRUE(exhausted);
  const MapHealth health = rig.engine->map_health();
  EXPECT_GT(health.pool_empty + health.table_full, 0u);
  EXPECT_GT(health.dropped_blocks, 0u);
  EXPECT_EQ(health.capacity, 300u);
  rig.mesh();
  rig.depth_of_map(k);
}

std::vector<PointState> states_of(const Engine& engine) {
  return test::states_in_corner(engine, 0.031f);
}

TEST(CpuEngine, BothFormsOfFreeSpaceKnowTheSameAndOneTakesAFractionOfTheMemory) {
  EngineParams dense = small_params(), lean = small_params();
  dense.map.free_space = FreeSpace::dense;
  lean.map.free_space = FreeSpace::hierarchical;
  Rig a(dense), b(lean);
  const Intrinsics k = corner_camera(kWidth);
  for (int n = 0; n < 80; ++n) {
    // The box comes after the room was seen, stays a while, and goes.
    const Se3d T = exp(Twistd{{0.1 * std::sin(0.2 * n), 0, -0.003 * n}, {0, 0.2 * std::sin(0.1 * n), 0}});
    const CornerView view(n >= 20 && n < 30 ? with_box() : CornerScene{}, k, T);
    for (Rig* rig : {&a, &b}) rig->add(view, cast<float>(T));
  }
  const std::vector<PointState> x = states_of(*a.engine), y = states_of(*b.engine);
  uint64_t different = 0, count[3] = {};
  for (size_t i = 0; i < x.size(); ++i) {
    different += x[i] != y[i];
    ++count[static_cast<int>(x[i])];
  }
  for (const uint64_t n : count) EXPECT_GT(n, x.size() / 50);
  EXPECT_LT(static_cast<double>(different), 0.001 * static_cast<double>(x.size()));
  EXPECT_LT(3 * b.engine->map_health().blocks, 2 * a.engine->map_health().blocks);
  EXPECT_LT(static_cast<double>(b.engine->map_health().bytes),
            1.25 * b.engine->map_health().peak_blocks * sizeof(VoxelBlock));
  EXPECT_EQ(a.mesh().triangle_count(), b.mesh().triangle_count());
}

TEST(CpuEngine, AMapReadBackInPiecesIsTheSameMap) {
  EngineParams p = small_params();
  p.map.free_space = FreeSpace::hierarchical;
  Rig from(p), to(p);
  const Intrinsics k = corner_camera(kWidth);
  from.add(CornerView(with_box(), k, {}), {}, 3);
  std::vector<uint64_t> keys(20000);
  keys.resize(from.engine->list_groups({keys.data(), 20000}));
  std::vector<uint8_t> record(kMaxGroupRecordBytes);
  for (const uint64_t key : keys) {
    const uint32_t bytes = from.engine->write_group(key, {record.data(), kMaxGroupRecordBytes});
    ASSERT_GT(bytes, 0u);
    ASSERT_EQ(to.engine->read_group({record.data(), bytes}), Status::ok);
  }
  EXPECT_EQ(states_of(*from.engine), states_of(*to.engine));
  EXPECT_TRUE(same_mesh(from.mesh(), to.mesh()));
  EXPECT_EQ(from.depth_of_map(k), to.depth_of_map(k));
}

TEST(CpuEngine, ResetForgetsTheMap) {
  Rig rig(paper_params());
  const Intrinsics k = corner_camera(kWidth);
  rig.add(CornerView({}, k, {}), {}, 2);
  EXPECT_GT(rig.engine->map_health().blocks, 0u);
  rig.engine->reset_map();
  EXPECT_EQ(rig.engine->map_health().blocks, 0u);
  EXPECT_EQ(rig.mesh().triangle_count(), 0u);
  for (const float z_m : rig.depth_of_map(k)) EXPECT_EQ(z_m, 0.0f);
  rig.add(CornerView({}, k, {}), {}, 2);
  EXPECT_GT(rig.mesh().triangle_count(), 100u);
}

TEST(CpuEngine, UndistortsWithTheCameraModel) {
  EngineParams p = paper_params();
  p.camera.distortion = {0.2f, -0.1f, 0.002f, -0.001f, 0.0f};
  Rig rig(p);
  const Intrinsics k = corner_camera(kWidth);
  // A depth that grows along the columns of the raw image shows where each pixel came from.
  CornerView view({}, k, {});
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c)
      view.depth_raw[static_cast<size_t>(r * k.width + c)] = static_cast<uint16_t>(5000 + 10 * c);
  ASSERT_EQ(rig.engine->prepare(frame_of(view)).status, Status::ok);
  for (const auto& [r, c] : {std::pair{60, 80}, {30, 40}, {90, 120}, {20, 130}}) {
    const Pixel from = distort(p.camera, {static_cast<float>(c), static_cast<float>(r)});
    EXPECT_NEAR(rig.engine->depth_image_m().at(r, c), 1.0f + 0.002f * std::round(from.u), 1e-5f);
  }
}

/// All that an engine says and keeps over a few frames with movement.
struct Trace {
  std::vector<TrackResult> tracks;
  std::vector<uint8_t> masks;
  std::vector<float> depth;
  MeshRecorder mesh;
  MapHealth health;

  Trace(EngineParams p, int32_t threads) {
    p.threads = threads;
    Rig rig(p);
    const Intrinsics k = corner_camera(kWidth);
    Se3 T;
    for (int n = 0; n < 8; ++n) {
      const Se3d truth = exp(Twistd{{0.01 * n, -0.005 * n, 0.004 * n}, {0.004 * n, 0.006 * n, 0}});
      CornerScene scene = n > 3 ? with_box() : CornerScene{};
      const CornerView view(scene, k, truth);
      EXPECT_EQ(rig.engine->prepare(frame_of(view)).status, Status::ok);
      if (n > 0) {
        tracks.push_back(rig.engine->track(T));
        rig.engine->mask(tracks.back().T_world_cam);
        tracks.push_back(rig.engine->refine(tracks.back().T_world_cam));
        T = tracks.back().T_world_cam;
        const ImageView<const uint8_t> mask = rig.engine->mask_image();
        masks.insert(masks.end(), mask.data, mask.data + mask.pixels());
      }
      rig.engine->integrate(T);
    }
    depth = rig.depth_of_map(k, T);
    mesh = rig.mesh();
    health = rig.engine->map_health();
  }
};

TEST(CpuEngine, TheSameBitsWithOneTwoAndFourThreads) {
  for (const EngineParams& params : {paper_params(), small_params()}) {
    const Trace one(params, 1);
    EXPECT_GT(one.mesh.triangle_count(), 1000u);
    EXPECT_GT(std::count(one.masks.begin(), one.masks.end(), 255), 1000);
    for (const int32_t threads : {2, 4}) {
      const Trace many(params, threads);
      ASSERT_EQ(one.tracks.size(), many.tracks.size());
      for (size_t i = 0; i < one.tracks.size(); ++i) {
        const TrackResult &a = one.tracks[i], &b = many.tracks[i];
        EXPECT_TRUE(same_bytes(a.T_world_cam, b.T_world_cam)) << threads << " threads, registration " << i;
        EXPECT_EQ(std::memcmp(a.covariance, b.covariance, sizeof a.covariance), 0);
        EXPECT_EQ(a.inlier_ratio, b.inlier_ratio);
        EXPECT_EQ(a.rmse_m, b.rmse_m);
      }
      EXPECT_TRUE(same_bytes(one.masks, many.masks));
      EXPECT_TRUE(same_bytes(one.depth, many.depth));
      EXPECT_TRUE(same_mesh(one.mesh, many.mesh));
      EXPECT_EQ(one.health.blocks, many.health.blocks);
    }
  }
}

}  // namespace
}  // namespace stillmap
