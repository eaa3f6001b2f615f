// A few frames of real recordings, which lie beside the project. STILLMAP_DATA names their folder.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "drivers/dataset/sevenscenes_source.hpp"
#include "drivers/dataset/tum_source.hpp"
#include "tests/support/frame_memory.hpp"

namespace stillmap {
namespace {

std::string recording(const std::string& name) {
  const char* const data = std::getenv("STILLMAP_DATA");
  return std::string(data ? data : "../shared/data") + "/" + name;
}

#define SKIP_WITHOUT(folder)                  \
  if (!std::filesystem::is_directory(folder)) \
  GTEST_SKIP() << folder << " is not there; STILLMAP_DATA names the folder of the recordings"

/// Share of the depth pixels that hold a measurement.
double valid_share(ImageView<const uint16_t> depth) {
  int valid = 0;
  for (int32_t i = 0; i < depth.pixels(); ++i) valid += depth.data[i] != 0 && depth.data[i] != 65535;
  return static_cast<double>(valid) / depth.pixels();
}

void expect_good_frames(FrameSource& source, int count) {
  test::FrameMemory buffer(source.info());
  Stamp last{-1};
  for (int i = 0; i < count; ++i) {
    ASSERT_EQ(source.next(buffer.frame, 0), Status::ok) << source.error();
    EXPECT_GT(buffer.frame.depth_stamp, last);
    last = buffer.frame.depth_stamp;
    EXPECT_GT(valid_share(buffer.frame.depth_raw), 0.3);
    EXPECT_TRUE(buffer.frame.truth_T_world_cam);
  }
}

TEST(Recordings, KitchenClip) {
  const std::string folder = recording("kitchen_clip");
  SKIP_WITHOUT(folder);
  const Result<std::unique_ptr<FrameSource>> source = open_sevenscenes(folder, {});
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->info().frames, 250);
  EXPECT_EQ((*source)->info().depth_units_per_m, 1000.0f);
  EXPECT_EQ((*source)->info().camera.k.fx, 585.0f);
  EXPECT_TRUE((*source)->info().camera.distortion.none());
  expect_good_frames(**source, 5);
}

TEST(Recordings, RpyClip) {
  const std::string folder = recording("rpy_clip");
  SKIP_WITHOUT(folder);
  const Result<std::unique_ptr<FrameSource>> source = open_tum(folder, {});
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->info().frames, 220);
  EXPECT_EQ((*source)->info().depth_units_per_m, 5000.0f);
  EXPECT_EQ((*source)->info().camera.k.fx, 517.3f);
  EXPECT_EQ((*source)->info().camera.distortion.k3, 1.1633f);
  expect_good_frames(**source, 5);
}

TEST(Recordings, KitchenWalkers) {
  const std::string folder = recording("kitchen_walkers");
  SKIP_WITHOUT(folder);
  const Result<std::unique_ptr<FrameSource>> source = open_tum(folder, {});
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->info().frames, 200);
  EXPECT_EQ((*source)->info().camera.k.cx, 320.0f);
  expect_good_frames(**source, 5);
}

}  // namespace
}  // namespace stillmap
