#include "kernels/integrate/visible_blocks.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "kernels/backend/cpu/loops.hpp"
#include "tests/support/analytic_map.hpp"
#include "tests/support/range_pyramid.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::RangePyramid;
using test::TestImage;

constexpr int32_t kViewRows = 60, kViewCols = 80;
constexpr float kSideM = 0.02f, kBandM = 0.08f;

/// A random depth image (rectangles at random depth, some without measurement) and a random pose.
class RandomFrame {
 public:
  explicit RandomFrame(uint32_t seed, FreeSpace free_space = FreeSpace::dense, uint32_t pool_blocks = 64)
      : map(pool_blocks, kSideM, kBandM, free_space),
        depth_(kViewRows, kViewCols),
        ranges_(kViewRows, kViewCols),
        random_(seed) {
    fill({0, kViewRows}, {0, kViewCols}, uniform(1.5f, 3.5f));
    for (int n = 0; n < 5; ++n) {
      const auto r = static_cast<int32_t>(uniform(0, kViewRows)),
                 c = static_cast<int32_t>(uniform(0, kViewCols));
      fill({r, std::min(kViewRows, r + 20)}, {c, std::min(kViewCols, c + 25)},
           n % 4 ? uniform(0.7f, 3.5f) : 0.0f);
    }
    ranges_.build(depth_.view(), {});
    const Vec3 axis = normalized(Vec3{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)});
    pass.T_cam_map = inverse(exp(Twist{{}, uniform(0, 3) * axis}));
    pass.T_cam_map.translation = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    pass.geometry = {
        ranges_.static_depth(), {70, 70, 39.5f, 29.5f, kViewCols, kViewRows}, 0.3f, 2.5f, 3.0f, kBandM};
    pass.ranges = ranges_.view();
    pass.map = map.view();
    pass.free_space = true;
    enclose();
  }

  AnalyticMap map;
  VisibleGroupPass pass{};

 private:
  float uniform(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }
  struct Range {
    int32_t first, end;
  };
  void fill(Range rows, Range cols, float z_m) {
    for (int32_t r = rows.first; r < rows.end; ++r)
      for (int32_t c = cols.first; c < cols.end; ++c) depth_.view().at(r, c) = z_m;
  }
  /// A box of groups around all that the camera can see, with room.
  void enclose() {
    const Se3 T_map_cam = inverse(pass.T_cam_map);
    const float group_m = kSideM * kBlockEdge * kGroupEdge, reach_m = 4.0f;
    const auto cell = [&](float x) { return static_cast<int32_t>(std::floor(x / group_m)); };
    const Vec3 c = T_map_cam.translation;
    pass.first_group = {cell(c.x - reach_m), cell(c.y - reach_m), cell(c.z - reach_m)};
    const Int3 last = {cell(c.x + reach_m), cell(c.y + reach_m), cell(c.z + reach_m)};
    pass.groups = {last.x - pass.first_group.x + 1, last.y - pass.first_group.y + 1,
                   last.z - pass.first_group.z + 1};
  }

  TestImage<float> depth_;
  RangePyramid ranges_;
  std::mt19937 random_;
};

/// What `observe` says about the voxels of a block.
struct Seen {
  int32_t free = 0, band = 0;
};
Seen look_at_voxels(const VisibleGroupPass& pass, Int3 block) {
  Seen seen;
  const VoxelGrid grid(pass.T_cam_map, block, pass.map.voxel_m);
  for (int32_t i = 0; i < kBlockVoxels; ++i) {
    const Observation<float> o =
        observe(pass.geometry, grid.position(static_cast<float>(i & 7), i >> 3 & 7, i >> 6));
    seen.free += o.free;
    seen.band += o.band;
  }
  return seen;
}

TEST(VisibleBlocks, EveryVoxelThatIsSeenLiesInAListedBlockAndFreeBlocksAreFree) {
  for (uint32_t seed = 1; seed <= 3; ++seed) {
    RandomFrame frame(seed);
    const VisibleGroupPass& pass = frame.pass;
    const auto count = static_cast<uint32_t>(pass.groups.x * pass.groups.y * pass.groups.z);
    int32_t listed = 0, free = 0, useless = 0;
    for (uint32_t g = 0; g < count; ++g) {
      const GroupView view = best_loops().visible_group(pass, g);
      EXPECT_EQ(view.free & view.mixed, 0u);
      for (int32_t bit = 0; bit < kGroupBlocks; ++bit) {
        const bool is_free = view.free >> bit & 1, is_mixed = view.mixed >> bit & 1;
        // Far groups are not looked at voxel by voxel: they are out of reach and must be empty.
        const Vec3 p_cam = pass.T_cam_map * voxel_position(first_voxel(pass.block_at(g, bit)), kSideM);
        if (!is_free && !is_mixed && (p_cam.z < 0.0f || p_cam.z > 3.3f)) continue;
        const Seen seen = look_at_voxels(pass, pass.block_at(g, bit));
        if (is_free) {
          EXPECT_EQ(seen.free, kBlockVoxels);
          ++free;
        } else if (is_mixed) {
          useless += seen.free + seen.band == 0;
        } else {
          EXPECT_EQ(seen.free + seen.band, 0) << "seed " << seed << " group " << g << " block " << bit;
        }
        listed += is_free || is_mixed;
      }
    }
    EXPECT_GT(listed, 100);
    EXPECT_GT(free, 20) << "seed " << seed;
    EXPECT_EQ(useless, 0);  // none is in the map yet: a block is listed only for a voxel of its own
  }
}

TEST(VisibleBlocks, PlainVoxelsAndRowsListTheSame) {
  RandomFrame frame(9);
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  for (uint32_t g = 0; g < count; ++g) {
    const GroupView plain = frame.pass(g, PlainVoxels{});
    const GroupView rows = kLoopsBaseline.visible_group(frame.pass, g);
    EXPECT_EQ(plain.free, rows.free);
    EXPECT_EQ(plain.mixed, rows.mixed);
  }
}

TEST(VisibleBlocks, WithoutFreeSpaceOnlyTheBandAndWhatIsThereAreListed) {
  RandomFrame frame(4);
  frame.pass.free_space = false;
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  for (uint32_t g = 0; g < count; ++g) {
    const GroupView view = best_loops().visible_group(frame.pass, g);
    EXPECT_EQ(view.free, 0u);
    for (int32_t bit = 0; bit < kGroupBlocks; ++bit) {
      const bool listed = view.mixed >> bit & 1;
      EXPECT_TRUE(!listed || look_at_voxels(frame.pass, frame.pass.block_at(g, bit)).band > 0);
    }
  }
  // A block in the map that is now seen free is listed all the same: it is to be carved.
  frame.pass.free_space = true;
  for (uint32_t g = 0; g < count; ++g) {
    const GroupView view = best_loops().visible_group(frame.pass, g);
    if (view.free == 0) continue;
    const int32_t bit = __builtin_ctzll(view.free);
    ASSERT_NE(frame.map.block(frame.pass.block_at(g, bit)), nullptr);
    frame.pass.free_space = false;
    EXPECT_EQ(best_loops().visible_group(frame.pass, g).free, 1ull << bit);
    break;
  }
}

TEST(VisibleBlocks, WithoutVoxelsInFreeSpaceOnlyTheBandAsksForVoxels) {
  int32_t free = 0, mixed = 0, partly = 0;
  for (uint32_t seed = 11; seed <= 13; ++seed) {
    RandomFrame frame(seed);
    frame.pass.dense = false;
    const VisibleGroupPass& pass = frame.pass;
    const auto count = static_cast<uint32_t>(pass.groups.x * pass.groups.y * pass.groups.z);
    for (uint32_t g = 0; g < count; ++g) {
      const GroupView view = best_loops().visible_group(pass, g), plain = pass(g, PlainVoxels{});
      EXPECT_EQ(view.free, plain.free);
      EXPECT_EQ(view.mixed, plain.mixed);
      EXPECT_EQ(view.partly, plain.partly);
      for (uint64_t bits = view.free | view.mixed | view.partly; bits; bits &= bits - 1) {
        const int32_t bit = __builtin_ctzll(bits);
        const Seen seen = look_at_voxels(pass, pass.block_at(g, bit));
        const bool is_free = view.free >> bit & 1, is_mixed = view.mixed >> bit & 1;
        EXPECT_EQ(is_mixed, seen.band > 0);
        EXPECT_EQ(is_free, seen.free == kBlockVoxels);
        ++(is_free ? free : is_mixed ? mixed : partly);
      }
    }
  }
  EXPECT_GT(free, 100);
  EXPECT_GT(mixed, 50);
  EXPECT_GT(partly, 50);
}

TEST(VisibleBlocks, WhatIsFreeForGoodIsNotListedAgain) {
  RandomFrame frame(12);
  frame.pass.dense = false;
  frame.pass.enough = 3;
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  const auto listed_free = [&](bool tell) {
    int32_t listed = 0;
    for (uint32_t g = 0; g < count; ++g)
      for (uint64_t bits = best_loops().visible_group(frame.pass, g).free; bits; bits &= bits - 1, ++listed)
        if (tell) frame.map.storage.see_free(frame.pass.block_at(g, __builtin_ctzll(bits)));
    return listed;
  };
  const int32_t all = listed_free(true);
  EXPECT_GT(all, 100);
  // Known blocks on the rim of the view are not looked at voxel by voxel again.
  const int32_t again = listed_free(true);
  EXPECT_GT(again, all / 2);
  EXPECT_LE(again, all);
  EXPECT_EQ(listed_free(true), again);
  EXPECT_EQ(listed_free(false), 0);
}

/// Frames of four in which a block without voxels is told, by whether anything new was seen of it last time.
struct Turns {
  int32_t free = 0, grew = 0, known = 0, others = 0;
};
Turns turns_of(RandomFrame& frame, uint32_t groups) {
  const VolumeView& map = frame.pass.map;
  const auto told = [](const GroupView& view) { return view.free | view.partly; };
  VisibleGroupPass always = frame.pass;
  always.first_looks = 1000;
  Turns turns;
  for (uint32_t g = 0; g < groups; ++g) {
    const uint64_t all = told(best_loops().visible_group(always, g));
    if (!has_id(map.table.find(pack(frame.pass.group_at(g))))) continue;
    int32_t times[kGroupBlocks] = {};
    for (frame.pass.frame = 0; frame.pass.frame < 4; ++frame.pass.frame)
      for (uint64_t bits = told(best_loops().visible_group(frame.pass, g)); bits; bits &= bits - 1)
        ++times[__builtin_ctzll(bits)];
    for (int32_t bit = 0; bit < kGroupBlocks; ++bit) {
      if (!(all >> bit & 1)) {
        EXPECT_EQ(times[bit], 0);
        continue;
      }
      const BlockRef ref = map.ref_of(frame.pass.block_at(g, bit));
      const bool partly = is_partly(ref) && map.partly[payload(ref)].looks >= frame.pass.first_looks;
      const bool free = is_free(ref) && payload(ref) >= frame.pass.first_looks;
      const bool grew = partly && map.partly[payload(ref)].grew;
      EXPECT_EQ(times[bit], free ? 1 : partly && !grew ? 2 : 4) << "group " << g << " block " << bit;
      ++(free ? turns.free : grew ? turns.grew : partly ? turns.known : turns.others);
    }
  }
  return turns;
}

TEST(VisibleBlocks, KnownBlocksWithoutVoxelsTakeTurnsUnlessSomethingIsNew) {
  RandomFrame frame(12, FreeSpace::hierarchical, 2000);
  frame.pass.dense = false;
  frame.pass.first_looks = 3;
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  std::vector<VisibleBlock> partly;
  for (uint32_t look = 0; look < frame.pass.first_looks; ++look)
    for (uint32_t g = 0; g < count; ++g) {
      const GroupView view = best_loops().visible_group(frame.pass, g);
      for (uint64_t bits = view.free; bits; bits &= bits - 1)
        frame.map.storage.see_free(frame.pass.block_at(g, __builtin_ctzll(bits)));
      for (uint64_t bits = view.partly; bits; bits &= bits - 1) {
        const InsertResult made = frame.map.storage.see_partly(frame.pass.block_at(g, __builtin_ctzll(bits)));
        ASSERT_NE(made.block, kNoBlock);
        if (look == 0) partly.push_back({made.block | VisibleBlock::kPartly});
      }
    }
  ASSERT_GT(partly.size(), 50u);
  const IntegratePass mark{
      frame.map.view(), frame.pass.geometry, nullptr, frame.pass.T_cam_map, {}, true, 0, false};
  const auto mark_all = [&] {
    best_loops().integrate(mark, {partly.data(), static_cast<uint32_t>(partly.size())});
  };
  mark_all();
  const Turns at_first = turns_of(frame, count);
  EXPECT_GT(at_first.free, 50);
  EXPECT_GT(at_first.grew, 50);
  EXPECT_EQ(at_first.known, 0);
  mark_all();  // the same once more
  const Turns then = turns_of(frame, count);
  EXPECT_EQ(then.grew, 0);
  EXPECT_EQ(then.known, at_first.grew);
  EXPECT_EQ(then.free, at_first.free);
}

TEST(VisibleBlocks, AGroupInTheArchiveIsWantedAndNothingIsListedInIt) {
  RandomFrame frame(12);
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  uint32_t group = 0;
  while (group < count && best_loops().visible_group(frame.pass, group).mixed == 0) ++group;
  ASSERT_LT(group, count);
  frame.map.storage.insert(pack(frame.pass.block_at(group, 0)));
  frame.map.storage.put_away(pack(frame.pass.group_at(group)), 5);
  const GroupView view = best_loops().visible_group(frame.pass, group);
  EXPECT_EQ(view.archived, archived_ref(5));
  EXPECT_EQ(view.free | view.mixed | view.partly, 0u);
}

TEST(VisibleBlocks, GroupsComeIntoViewAMarginBeforeTheyAreSeen) {
  RandomFrame frame(12);
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  int32_t seen = 0, near = 0;
  for (const float margin_m : {0.0f, 0.5f}) {
    frame.pass.margin_m = margin_m;
    for (uint32_t g = 0; g < count; ++g)
      (margin_m > 0 ? near : seen) += frame.pass.comes_into_view(frame.pass.group_at(g));
  }
  EXPECT_GT(seen, 10);
  EXPECT_GT(near, seen + seen / 10);
}

TEST(VisibleBlocks, NothingIsListedWhenNothingWasMeasured) {
  RandomFrame frame(5);
  const TestImage<float> nothing(kViewRows, kViewCols);
  RangePyramid ranges(kViewRows, kViewCols);
  ranges.build(nothing.view(), {});
  frame.pass.ranges = ranges.view();
  frame.pass.geometry.static_depth_m = ranges.static_depth();
  const auto count = static_cast<uint32_t>(frame.pass.groups.x * frame.pass.groups.y * frame.pass.groups.z);
  for (uint32_t g = 0; g < count; ++g) {
    const GroupView view = best_loops().visible_group(frame.pass, g);
    EXPECT_EQ(view.free | view.mixed, 0u);
  }
}

}  // namespace
}  // namespace stillmap
