#include "drivers/dataset/sevenscenes_source.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/support/tiny_dataset.hpp"

namespace stillmap {
namespace {

using test::contains;
using test::FrameMemory;
using test::sevenscenes_name;
using test::TempDir;

constexpr const char* kPose = "0 -1 0 1.5\n1 0 0 -2.5\n0 0 1 3.5\n0 0 0 1\n";

std::unique_ptr<FrameSource> open(const TempDir& dir) {
  if (!std::filesystem::exists(dir / "camera.toml")) test::write_text(dir / "camera.toml", test::kTinyCamera);
  Result<std::unique_ptr<FrameSource>> source = open_sevenscenes(dir.path(), {});
  EXPECT_TRUE(source) << source.error();
  return source ? std::move(*source) : nullptr;
}

TEST(SevenScenes, StampsAreThirtiethsToTheNearestNanosecond) {
  EXPECT_EQ(sevenscenes_stamp(0).ns, 0);
  EXPECT_EQ(sevenscenes_stamp(1).ns, 33333333);
  EXPECT_EQ(sevenscenes_stamp(2).ns, 66666667);
  EXPECT_EQ(sevenscenes_stamp(3).ns, 100000000);
  EXPECT_EQ(sevenscenes_stamp(999999999).ns, 33333333300000000);
}

TEST(SevenScenes, NumbersMayStartAnywhereAndHaveGaps) {
  const TempDir dir;
  for (const int number : {30, 10, 12}) test::write_sevenscenes_frame(dir, number);
  test::write_text(dir / "readme.txt", "not a frame");
  test::write_text(dir / "frame-xx.depth.png", "not a frame");
  const auto source = open(dir);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().name, "sevenscenes:" + dir.path());
  EXPECT_EQ(source->info().depth_units_per_m, 1000.0f);
  EXPECT_EQ(source->info().frames, 3);
  FrameMemory buffer(source->info());
  for (const int number : {10, 12, 30}) {
    ASSERT_EQ(source->next(buffer.frame, 0), Status::ok) << source->error();
    EXPECT_EQ(buffer.frame.depth_stamp, sevenscenes_stamp(number));
    EXPECT_EQ(
        buffer.frame.depth_raw.at(2, 3),
        test::depth_pattern(test::kTinyRows, test::kTinyCols, static_cast<uint32_t>(number)).view().at(2, 3));
  }
  EXPECT_EQ(source->next(buffer.frame, 0), Status::end);
}

TEST(SevenScenes, CameraIsKnownForTheUsualSize) {
  const TempDir dir;
  ASSERT_TRUE(write_png16(dir / sevenscenes_name(0, "depth.png"), test::depth_pattern(480, 640).view()));
  ASSERT_TRUE(write_png(dir / sevenscenes_name(0, "color.png"), test::colour_pattern(480, 640).view()));
  const Result<std::unique_ptr<FrameSource>> source = open_sevenscenes(dir.path(), {});
  ASSERT_TRUE(source) << source.error();
  const Intrinsics& k = (*source)->info().camera.k;
  EXPECT_EQ(k.fx, 585.0f);
  EXPECT_EQ(k.fy, 585.0f);
  EXPECT_EQ(k.cx, 320.0f);
  EXPECT_EQ(k.cy, 240.0f);
  EXPECT_EQ(k.width, 640);
}

TEST(SevenScenes, CameraOfAnotherSizeIsBadUsage) {
  const TempDir dir;
  test::write_sevenscenes_frame(dir, 0);  // 16x12 pixels: 320,240 lies outside
  const Result<std::unique_ptr<FrameSource>> source = open_sevenscenes(dir.path(), {});
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error_kind(), ErrorKind::bad_usage);
}

TEST(SevenScenes, PoseIsTruth) {
  const TempDir dir;
  for (int number = 0; number < 4; ++number) test::write_sevenscenes_frame(dir, number);
  test::write_text(dir / sevenscenes_name(0, "pose.txt"), kPose);
  test::write_text(dir / sevenscenes_name(1, "pose.txt"), "nan nan nan nan\n");
  test::write_text(dir / sevenscenes_name(2, "pose.txt"), "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  const auto source = open(dir);
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  ASSERT_TRUE(buffer.frame.truth_T_world_cam);
  const Vec3d p_world = *buffer.frame.truth_T_world_cam * Vec3d{1, 0, 0};
  EXPECT_DOUBLE_EQ(p_world.x, 1.5);
  EXPECT_DOUBLE_EQ(p_world.y, -1.5);
  EXPECT_DOUBLE_EQ(p_world.z, 3.5);
  for (int number = 1; number < 4; ++number) {
    ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
    EXPECT_FALSE(buffer.frame.truth_T_world_cam) << number;
  }
}

TEST(SevenScenes, IncompleteFramesArePassedOver) {
  const TempDir dir;
  for (int number = 0; number < 4; ++number) test::write_sevenscenes_frame(dir, number);
  std::filesystem::remove(dir / sevenscenes_name(1, "color.png"));
  std::filesystem::remove(dir / sevenscenes_name(2, "depth.png"));
  const auto source = open(dir);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().frames, 4);
  FrameMemory buffer(source->info());
  EXPECT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(source->next(buffer.frame, 0), Status::bad_data);
  EXPECT_TRUE(contains(source->error(), "frame-000001.color.png or .color.jpg: is missing"))
      << source->error();
  EXPECT_EQ(source->next(buffer.frame, 0), Status::bad_data);
  EXPECT_TRUE(contains(source->error(), "frame-000002.depth.png: is missing")) << source->error();
  EXPECT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(buffer.frame.sequence, 3u);
}

TEST(SevenScenes, FolderWithoutFramesIsAnError) {
  const TempDir dir;
  for (const std::string& folder : {dir.path(), dir.path() + "/none"}) {
    const Result<std::unique_ptr<FrameSource>> source = open_sevenscenes(folder, {});
    ASSERT_FALSE(source);
    EXPECT_EQ(source.error_kind(), ErrorKind::cannot_open);
    EXPECT_TRUE(contains(source.error(), folder));
  }
}

TEST(SevenScenes, MutatedPosesNeverCrash) {
  constexpr uint32_t kSeed = 3;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const TempDir dir;
  test::write_sevenscenes_frame(dir, 0);
  int poses = 0, refused = 0;
  for (int round = 0; round < 500; ++round) {
    std::string text = kPose;
    for (size_t change = 0, changes = 1 + random() % 4; change < changes; ++change) {
      const size_t at = random() % text.size();
      switch (random() % 3) {
        case 0:
          text[at] = static_cast<char>(random());
          break;
        case 1:
          text.erase(at, 1 + random() % 3);
          break;
        default:
          text.insert(at, 1, "0123456789.e- \n"[random() % 15]);
      }
    }
    test::write_text(dir / sevenscenes_name(0, "pose.txt"), text);
    const auto source = open(dir);
    ASSERT_TRUE(source);
    FrameMemory buffer(source->info());
    ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
    const auto& truth = buffer.frame.truth_T_world_cam;
    (truth ? poses : refused) += 1;
    if (truth) {
      EXPECT_TRUE(std::isfinite(truth->translation.x + truth->rotation(0, 0)));
    }
  }
  EXPECT_GT(poses, 20);
  EXPECT_GT(refused, 20);
}

}  // namespace
}  // namespace stillmap
