#include "drivers/synthetic/synthetic_source.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "tests/support/frame_memory.hpp"

namespace stillmap {
namespace {

using test::FrameMemory;

bool same_bytes(const FrameMemory& a, const FrameMemory& b) {
  return a.depth == b.depth && std::memcmp(a.colour.data(), b.colour.data(), 3 * a.colour.size()) == 0 &&
         a.mask == b.mask && a.frame.depth_stamp == b.frame.depth_stamp;
}

std::unique_ptr<FrameSource> opened(const std::string& spec, int threads = 1) {
  auto source = open_synthetic(spec, threads);
  EXPECT_TRUE(source) << source.error();
  return std::move(*source);
}

/// The frame `index` of a source, 96 x 72.
FrameMemory frame_of(const std::string& spec, uint32_t index, int threads = 1) {
  FrameMemory memory(96, 72);
  const auto source = opened(spec + ",size=96x72", threads);
  source->skip(index);
  EXPECT_EQ(source->next(memory.frame, 0), Status::ok) << spec;
  EXPECT_EQ(memory.frame.sequence, index);
  return memory;
}

TEST(SyntheticSource, says_what_it_is) {
  const auto source = opened("crowd,size=320x240,seconds=11");
  const SourceInfo& info = source->info();
  EXPECT_EQ(info.name, "synthetic:crowd,size=320x240,seconds=11");
  EXPECT_EQ(info.frames, 330);
  EXPECT_TRUE(info.has_truth_mask);
  EXPECT_EQ(info.depth_units_per_m, 5000.0f);
  EXPECT_TRUE(info.camera.distortion.none());
  EXPECT_EQ(info.camera.k.width, 320);
  EXPECT_EQ(info.camera.k.height, 240);
  EXPECT_FLOAT_EQ(info.camera.k.fx, 262.5f);
  EXPECT_FLOAT_EQ(info.camera.k.cx, 159.5f);
  const Intrinsics vga = opened("static")->info().camera.k;
  EXPECT_FLOAT_EQ(vga.fx, 525.0f);
  EXPECT_FLOAT_EQ(vga.fy, 525.0f);
  EXPECT_FLOAT_EQ(vga.cx, 319.5f);
  EXPECT_FLOAT_EQ(vga.cy, 239.5f);
}

TEST(SyntheticSource, lists_its_scenes) {
  std::string names;
  for (const std::string& name : synthetic_scene_names()) names += name + " ";
  EXPECT_EQ(names,
            "static balloon balloon_tracking crowd crowd_start crowd_close moving_box obstructing_box "
            "placing_box removing_box placing_obstructing_box person_tracking synchronous kidnapping_box "
            "loop fast covered camera_kidnapped long_loop corridor hall near ");
}

TEST(SyntheticSource, a_covered_lens_measures_nothing_and_sees_dark) {
  const auto source = opened("covered,size=64x48");
  FrameMemory memory(source->info());
  const auto covered = [&](uint32_t first, uint32_t count) {
    source->skip(first);
    uint32_t frames = 0;
    for (uint32_t i = 0; i < count; ++i) {
      EXPECT_EQ(source->next(memory.frame, 0), Status::ok);
      const auto& [depth, colour, mask, frame] = memory;
      const bool blind = std::all_of(depth.begin(), depth.end(), [](uint16_t d) { return d == 0; });
      const bool dark =
          std::all_of(colour.begin(), colour.end(), [](Rgb8 c) { return c.r < 50 && c.g < 30; });
      EXPECT_EQ(blind, dark);
      EXPECT_EQ(blind, std::all_of(mask.begin(), mask.end(), [](uint8_t m) { return m == 255; }));
      frames += blind ? 1 : 0;
    }
    return frames;
  };
  EXPECT_EQ(covered(260, 110), 90u);  // seconds 9 to 12
}

TEST(SyntheticSource, errors_of_the_spec_come_through) {
  const auto source = open_synthetic("circus");
  ASSERT_FALSE(source);
  EXPECT_NE(source.error().find("balloon_tracking"), std::string::npos);
}

TEST(SyntheticSource, same_seed_same_bytes_with_any_number_of_threads) {
  for (const char* scene : {"crowd", "synchronous"}) {
    const FrameMemory one = frame_of(scene, 130, 1);
    EXPECT_TRUE(same_bytes(one, frame_of(scene, 130, 1)));
    EXPECT_TRUE(same_bytes(one, frame_of(scene, 130, 3)));
    EXPECT_TRUE(same_bytes(one, frame_of(std::string(scene) + ",seed=1", 130, 2)));
  }
}

TEST(SyntheticSource, another_seed_is_other_noise_in_the_same_world) {
  const FrameMemory one = frame_of("crowd,seed=1", 130);
  for (const char* seed : {"2", "0", "4294967297"}) {
    const FrameMemory other = frame_of(std::string("crowd,seed=") + seed, 130);
    EXPECT_NE(one.depth, other.depth) << seed;
    EXPECT_NE(std::memcmp(one.colour.data(), other.colour.data(), 3 * one.colour.size()), 0) << seed;
    EXPECT_EQ(one.mask, other.mask) << seed;
    EXPECT_EQ(norm(one.frame.truth_T_world_cam->translation - other.frame.truth_T_world_cam->translation),
              0.0);
  }
}

TEST(SyntheticSource, skipped_frames_change_nothing_after_them) {
  FrameMemory walked(64, 48), jumped(64, 48);
  const auto slow = opened("balloon,size=64x48"), quick = opened("balloon,size=64x48");
  for (int i = 0; i <= 20; ++i) ASSERT_EQ(slow->next(walked.frame, 0), Status::ok);
  quick->skip(15);
  quick->skip(5);
  ASSERT_EQ(quick->next(jumped.frame, 0), Status::ok);
  EXPECT_EQ(jumped.frame.sequence, 20u);
  EXPECT_TRUE(same_bytes(walked, jumped));
}

TEST(SyntheticSource, thirty_frames_a_second_then_the_end) {
  FrameMemory memory(64, 48);
  const auto source = opened("static,size=64x48,seconds=0.2");
  ASSERT_EQ(source->info().frames, 6);
  for (int64_t i = 0; i < 6; ++i) {
    ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
    EXPECT_NEAR(memory.frame.depth_stamp.seconds(), static_cast<double>(i) / 30.0, 1e-9);
    EXPECT_EQ(memory.frame.colour_stamp, memory.frame.depth_stamp);
  }
  EXPECT_EQ(source->next(memory.frame, 0), Status::end);
  EXPECT_EQ(source->next(memory.frame, 0), Status::end);
  source->skip(4000000000u);
  EXPECT_EQ(source->next(memory.frame, 0), Status::end);
}

TEST(SyntheticSource, the_twin_has_the_same_path_and_nothing_that_moves) {
  for (const std::string& scene : synthetic_scene_names()) {
    const FrameMemory with = frame_of(scene, 200), without = frame_of(scene + "-static", 200);
    EXPECT_EQ(std::count(without.mask.begin(), without.mask.end(), 0), 96 * 72) << scene;
    const Se3d& a = *with.frame.truth_T_world_cam;
    const Se3d& b = *without.frame.truth_T_world_cam;
    EXPECT_EQ(norm(a.translation - b.translation), 0.0) << scene;
    for (int i = 0; i < 9; ++i) EXPECT_EQ(a.rotation.m[i], b.rotation.m[i]) << scene;
    // Same noise: where no mover is near, colours agree to the byte.
    size_t same = 0, unmasked = 0;
    for (size_t i = 0; i < with.mask.size(); ++i) {
      if (with.mask[i] != 0) continue;
      ++unmasked;
      same += std::memcmp(&with.colour[i], &without.colour[i], 3) == 0 ? 1 : 0;
    }
    EXPECT_GT(static_cast<double>(same), 0.6 * static_cast<double>(unmasked)) << scene;
  }
}

TEST(SyntheticSource, values_are_bounded_and_most_depths_are_there) {
  for (const std::string& scene : synthetic_scene_names()) {
    const FrameMemory memory = frame_of(scene, 110);
    int valid = 0;
    for (size_t i = 0; i < memory.depth.size(); ++i) {
      const int d = memory.depth[i];
      ASSERT_TRUE(d == 0 || (d >= 2249 && d <= 25001)) << scene << " " << d;
      ASSERT_TRUE(memory.mask[i] == 0 || memory.mask[i] == 255);
      valid += d != 0 ? 1 : 0;
    }
    EXPECT_GT(valid, 96 * 72 * (synthetic_scene_wants_completion(scene) ? 4 : 6) / 10) << scene;
  }
}

TEST(SyntheticSource, respects_the_pitch_of_the_callers_images) {
  FrameMemory tight(96, 72), padded(96, 72, 5);
  const auto a = opened("crowd_start,size=96x72"), b = opened("crowd_start,size=96x72");
  ASSERT_EQ(a->next(tight.frame, 0), Status::ok);
  ASSERT_EQ(b->next(padded.frame, 0), Status::ok);
  for (int32_t r = 0; r < 72; ++r) {
    EXPECT_EQ(std::memcmp(tight.frame.depth_raw.row(r), padded.frame.depth_raw.row(r), 96 * 2), 0);
    EXPECT_EQ(std::memcmp(tight.frame.colour.row(r), padded.frame.colour.row(r), 96 * 3), 0);
    EXPECT_EQ(std::memcmp(tight.frame.truth_mask.row(r), padded.frame.truth_mask.row(r), 96), 0);
    for (int32_t c = 96; c < 101; ++c) {
      EXPECT_EQ(padded.depth[static_cast<size_t>(r * 101 + c)], FrameMemory::kUntouchedDepth);
      EXPECT_EQ(padded.mask[static_cast<size_t>(r * 101 + c)], FrameMemory::kUntouchedMask);
    }
  }
}

TEST(SyntheticSource, works_without_memory_for_the_mask) {
  FrameMemory memory(64, 48);
  memory.frame.truth_mask = {};
  EXPECT_EQ(opened("crowd,size=64x48")->next(memory.frame, 0), Status::ok);
}

TEST(SyntheticSource, images_of_another_size_are_refused_and_named) {
  FrameMemory wrong(96, 72), none(64, 48);
  const auto source = opened("crowd,size=64x48");
  EXPECT_EQ(source->next(wrong.frame, 0), Status::bad_data);
  EXPECT_NE(source->error().find("64x48"), std::string::npos);
  none.frame.colour.data = nullptr;
  EXPECT_EQ(source->next(none.frame, 0), Status::bad_data);
}

TEST(SyntheticSource, odd_and_full_sizes_render) {
  for (const auto& [cols, rows] : {std::pair{65, 49}, std::pair{1920, 1080}, std::pair{1920, 48}}) {
    FrameMemory memory(cols, rows);
    const auto source = opened("crowd_start,size=" + std::to_string(cols) + "x" + std::to_string(rows), 2);
    ASSERT_EQ(source->next(memory.frame, 0), Status::ok);
    const auto valid =
        memory.depth.size() - static_cast<size_t>(std::count(memory.depth.begin(), memory.depth.end(), 0));
    EXPECT_GT(valid, memory.depth.size() / 2);
    EXPECT_EQ(std::count(memory.depth.begin(), memory.depth.end(), FrameMemory::kUntouchedDepth), 0);
  }
}

}  // namespace
}  // namespace stillmap
