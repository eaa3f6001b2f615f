#include "kernels/raycast/ray_ranges.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "kernels/backend/cpu/raycast.hpp"
#include "tests/support/analytic_map.hpp"

namespace stillmap {
namespace {

const Intrinsics kView = {150, 150, 99.5f, 69.5f, 203, 141};  // not whole tiles

/// A room with two things in it, observed up to the truncation distance behind surfaces.
AnalyticSample room(Vec3d p) {
  AnalyticSample s;
  const double walls = -box_sdf(p, {0, 0, 0}, {0.42, 0.36, 0.46});
  s.sdf_m = std::min(
      {walls, sphere_sdf(p, {0.15, 0.1, 0.2}, 0.09), box_sdf(p, {-0.2, -0.15, 0.25}, {0.08, 0.1, 0.06})});
  s.observed = s.sdf_m > -0.1;
  s.colour = {static_cast<uint8_t>(std::lround(p.x * 100 + 128)), 100, 50};
  return s;
}

struct Picture {
  std::vector<float> depth_m;
  std::vector<Rgb8> colour;
  std::vector<uint64_t> scratch = std::vector<uint64_t>(raycast_scratch_bytes() / 8);

  RaycastPass pass(AnalyticMap& map, const Se3& T_map_cam, const Intrinsics& k) {
    const auto pixels = static_cast<size_t>(k.width) * static_cast<size_t>(k.height);
    depth_m.assign(pixels, -1.0f);
    colour.assign(pixels, {});
    return {map.view(),
            k,
            T_map_cam,
            {depth_m.data(), k.height, k.width, k.width},
            {colour.data(), k.height, k.width, k.width}};
  }
  View<uint8_t> memory() {
    return {reinterpret_cast<uint8_t*>(scratch.data()), static_cast<uint32_t>(raycast_scratch_bytes())};
  }
};

Se3 random_pose(std::mt19937& random, float reach_m) {
  std::uniform_real_distribution<float> place(-reach_m, reach_m), turn(-3.0f, 3.0f);
  Se3 pose = exp(Twist{{}, {turn(random), turn(random), turn(random)}});
  pose.translation = {place(random), place(random), place(random)};
  return pose;
}

TEST(RayRanges, SkippingFreeSpaceDoesNotChangeThePicture) {
  AnalyticMap map(3500);
  map.fill({-7, -7, -7}, {6, 6, 7}, room);
  std::mt19937 random(2);
  ThreadPool threads(2);
  int all_hits = 0;
  for (int i = 0; i < 12; ++i) {
    const Se3 pose = random_pose(random, i < 7 ? 0.3f : 1.5f);
    Picture skipped, whole;
    RaycastPass plain = whole.pass(map, pose, kView), fast = skipped.pass(map, pose, kView);
    plain.through_backs = fast.through_backs = i % 2 == 1;
    raycast_rows(plain, 0, kView.height);
    ASSERT_EQ(raycast(fast, skipped.memory(), threads), Status::ok);
    int hits = 0, different = 0;
    for (size_t p = 0; p < whole.depth_m.size(); ++p) {
      hits += whole.depth_m[p] > 0;
      different += std::fabs(whole.depth_m[p] - skipped.depth_m[p]) > 2e-3f;
    }
    all_hits += hits;
    // Rays that graze an edge see it or not as their steps fall.
    EXPECT_LE(different, 20 + hits / 200) << "view " << i;
  }
  EXPECT_GT(all_hits, 40000);
}

TEST(RayRanges, HoldEverySurfaceAndLeaveFreeSpaceOut) {
  AnalyticMap map(3500);
  map.fill({-7, -7, -7}, {6, 6, 7}, room);
  Picture picture;
  const Se3 back{{}, {0, 0, -0.3f}};
  RaycastPass pass = picture.pass(map, back, kView);
  raycast_rows(pass, 0, kView.height);
  std::vector<RayRange> tiles(26 * 18);
  const RayRanges ranges{{tiles.data(), 18, 26, 26}, RayRanges::tile_px_for(kView.height, kView.width)};
  ASSERT_EQ(ranges.tile_px, 8);
  const RayRangesPass ranging{map.view(), kView, inverse(back), 0.05f, 10.0f, ranges};
  for (BlockId id = 0; id < map.view().block_keys.size; ++id) ranging(id);
  int hits = 0, skipped = 0;
  for (int32_t r = 0; r < kView.height; ++r)
    for (int32_t c = 0; c < kView.width; ++c) {
      const float depth = pass.depth_m.at(r, c);
      if (!(depth > 0)) continue;
      const RayRange range = ranges.of_pixel(r, c);
      ASSERT_LE(float_of(range.nearest_bits), depth) << r << ' ' << c;
      ASSERT_GE(float_of(range.farthest_bits), depth) << r << ' ' << c;
      ++hits;
      skipped += float_of(range.nearest_bits) > 0.5f * depth;
    }
  EXPECT_EQ(hits, kView.height * kView.width);
  EXPECT_GT(skipped, hits / 2);
}

TEST(RayRanges, NothingInViewLeavesTilesEmpty) {
  AnalyticMap map(100);
  map.fill({0, 0, 10}, {1, 1, 11}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = 0.88 - p.z;
    return s;
  });
  std::vector<RayRange> tiles(26 * 18);
  const RayRanges ranges{{tiles.data(), 18, 26, 26}, 8};
  const Se3 looking_back = exp(Twist{{}, {0, 3.1415927f, 0}});
  const RayRangesPass ranging{map.view(), kView, inverse(looking_back), 0.05f, 10.0f, ranges};
  for (BlockId id = 0; id < map.view().block_keys.size; ++id) ranging(id);
  for (const RayRange& tile : tiles) ASSERT_EQ(tile.farthest_bits, 0u);
}

TEST(Raycast, AnyNumberOfThreadsAndAnyIdsGiveTheSameBytes) {
  Picture reference;
  for (const int32_t threads : {1, 2, 4}) {
    AnalyticMap map(3500);
    if (threads > 1) map.shuffle_ids(static_cast<uint32_t>(threads));
    map.fill({-7, -7, -7}, {6, 6, 7}, room);
    ThreadPool pool(threads);
    Picture picture;
    ASSERT_EQ(raycast(picture.pass(map, {}, kView), picture.memory(), pool), Status::ok);
    if (threads == 1) {
      reference = picture;
      continue;
    }
    EXPECT_EQ(picture.depth_m, reference.depth_m);
    EXPECT_EQ(std::memcmp(picture.colour.data(), reference.colour.data(), reference.colour.size() * 3), 0);
  }
}

TEST(Raycast, ViewsOfAnySizeFitTheScratch) {
  AnalyticMap map(3500);
  map.fill({-7, -7, -7}, {6, 6, 7}, room);
  ThreadPool pool(2);
  for (const auto& [rows, cols] : {std::pair{1, 1}, {1, 3000}, {777, 5}, {900, 1200}}) {
    const Intrinsics k = {300, 300, static_cast<float>(cols) / 2, static_cast<float>(rows) / 2, cols, rows};
    const int32_t px = RayRanges::tile_px_for(rows, cols);
    EXPECT_EQ(px % 8, 0);
    EXPECT_LE(std::max(rows, cols), px * RayRanges::kMaxEdge);
    Picture picture;
    ASSERT_EQ(raycast(picture.pass(map, {}, k), picture.memory(), pool), Status::ok);
    for (const float d : picture.depth_m) ASSERT_GE(d, 0.0f);
    EXPECT_GT(picture.depth_m[static_cast<size_t>(rows / 2 * cols + cols / 2)], 0.0f);
  }
}

TEST(Raycast, RefusesWhatDoesNotFit) {
  AnalyticMap map(10);
  ThreadPool pool(1);
  Picture picture;
  const RaycastPass good = picture.pass(map, {}, kView);
  EXPECT_EQ(raycast(good, picture.memory(), pool), Status::ok);
  RaycastPass bad = good;
  bad.depth_m.rows -= 1;
  EXPECT_EQ(raycast(bad, picture.memory(), pool), Status::out_of_range);
  bad = good;
  bad.colour.cols += 1;
  EXPECT_EQ(raycast(bad, picture.memory(), pool), Status::out_of_range);
  bad = good;
  bad.k.fx = 0;
  EXPECT_EQ(raycast(bad, picture.memory(), pool), Status::out_of_range);
  bad = good;
  bad.k.fy = std::nanf("");
  EXPECT_EQ(raycast(bad, picture.memory(), pool), Status::out_of_range);
  const View<uint8_t> memory = picture.memory();
  EXPECT_EQ(raycast(good, {memory.data, memory.size - 1}, pool), Status::out_of_range);
  EXPECT_EQ(raycast(picture.pass(map, {}, {1, 1, 0, 0, 0, 0}), memory, pool), Status::out_of_range);
}

TEST(Raycast, OddPosesEndAndSeeNothing) {
  AnalyticMap map(1000);
  map.fill({-4, -4, -4}, {3, 3, 3}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = sphere_sdf(p, {}, 0.2);
    return s;
  });
  ThreadPool pool(1);
  Picture picture;
  for (const float odd : {std::nanf(""), INFINITY, -INFINITY, 1e30f, 1e7f}) {
    ASSERT_EQ(raycast(picture.pass(map, {{}, {odd, 0, 0}}, kView), picture.memory(), pool), Status::ok);
    for (const float d : picture.depth_m) ASSERT_EQ(d, 0.0f);
    Se3 twisted;
    twisted.rotation.m[4] = odd;
    ASSERT_EQ(raycast(picture.pass(map, twisted, kView), picture.memory(), pool), Status::out_of_range);
  }
}

}  // namespace
}  // namespace stillmap
