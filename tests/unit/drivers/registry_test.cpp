#include "drivers/registry.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/support/tiny_dataset.hpp"

namespace stillmap {
namespace {

using test::contains;

void expect_refused(const std::string& source, ErrorKind kind, const std::string& message) {
  const Result<std::unique_ptr<FrameSource>> opened = open_source(source, {});
  ASSERT_FALSE(opened) << source;
  EXPECT_EQ(opened.error_kind(), kind) << opened.error();
  EXPECT_TRUE(contains(opened.error(), message)) << opened.error();
}

TEST(Registry, OpensRecordings) {
  const test::TempDir dir;
  test::write_tum_images(dir, 1);
  test::write_text(dir / "associated.txt", "1.0 depth/0.png 1.0 rgb/0.png\n");
  test::write_sevenscenes_frame(dir, 0);
  SourceOptions options;
  options.dataset.camera = CameraModel{{20, 20, 8, 6, 0, 0}, {}};
  for (const char* scheme : {"tum:", "sevenscenes:"}) {
    const Result<std::unique_ptr<FrameSource>> source = open_source(scheme + dir.path(), options);
    ASSERT_TRUE(source) << source.error();
    EXPECT_EQ((*source)->info().name, scheme + dir.path());
    test::FrameMemory buffer((*source)->info());
    EXPECT_EQ((*source)->next(buffer.frame, 0), Status::ok) << (*source)->error();
  }
}

/// Bytes of the depth image of the first frame.
std::vector<uint16_t> first_depth(FrameSource& source) {
  test::FrameMemory buffer(source.info());
  EXPECT_EQ(source.next(buffer.frame, 0), Status::ok) << source.error();
  const ImageView<uint16_t>& depth = buffer.frame.depth_raw;
  std::vector<uint16_t> raw;
  for (int32_t r = 0; r < depth.rows; ++r) raw.insert(raw.end(), depth.row(r), depth.row(r) + depth.cols);
  return raw;
}

TEST(Registry, CalibrationsReachTheSource) {
  const test::TempDir dir;
  test::write_tum_images(dir, 1);
  test::write_text(dir / "associated.txt", "1.0 depth/0.png 1.0 rgb/0.png\n");
  const std::string lens = "fx = 20.0\nfy = 21.0\ncx = 8.0\ncy = 6.0\n";
  // Without another camera than colour's: camera.toml of the folder.
  test::write_text(dir / "camera.toml", "depth_scale = 1000\ndepth_bias = [0, 1.02]\n" + lens);
  auto plain = open_source("tum:" + dir.path(), {});
  ASSERT_TRUE(plain) << plain.error();
  EXPECT_EQ((*plain)->info().depth_bias.c[1], 1.02f);
  EXPECT_EQ((*plain)->info().depth_units_per_m, 1000.0f);
  const auto raw = first_depth(**plain);
  // camera.calibration wins over it, and depth that is not registered is registered.
  test::write_text(dir / "my.toml", "depth_bias = [0, 1.03]\n[colour]\n" + lens + "[depth]\n" + lens +
                                        "T_colour_depth = [-0.1, 0, 0, 0, 0, 0, 1]\n");
  SourceOptions options;
  options.dataset.calibration = dir / "my.toml";
  auto calibrated = open_source("tum:" + dir.path(), options);
  ASSERT_TRUE(calibrated) << calibrated.error();
  EXPECT_EQ((*calibrated)->info().depth_bias.c[1], 1.03f);
  EXPECT_FALSE((*calibrated)->info().depth_camera);
  const auto registered = first_depth(**calibrated);
  EXPECT_NE(registered, raw);
  // The same said by the folder itself.
  test::write_text(dir / "camera.toml",
                   lens + "[depth]\n" + lens + "T_colour_depth = [-0.1, 0, 0, 0, 0, 0, 1]\n");
  auto by_folder = open_source("tum:" + dir.path(), {});
  ASSERT_TRUE(by_folder) << by_folder.error();
  EXPECT_FALSE((*by_folder)->info().depth_camera);
  EXPECT_NE(first_depth(**by_folder), raw);
  // What a scene's camera is, is known exactly.
  auto scene = open_source("synthetic:static,size=64x48,seconds=1", options);
  ASSERT_TRUE(scene) << scene.error();
  EXPECT_TRUE((*scene)->info().depth_bias.none());
  options.dataset.calibration = dir / "no.toml";
  EXPECT_EQ(open_source("tum:" + dir.path(), options).error_kind(), ErrorKind::bad_usage);
}

TEST(Registry, OpensSyntheticScenes) {
  const Result<std::unique_ptr<FrameSource>> source =
      open_source("synthetic:static,size=64x48,seconds=1", {});
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->info().camera.k.width, 64);
  expect_refused("synthetic:no_such_scene", ErrorKind::bad_usage, "no_such_scene");
}

TEST(Registry, UnknownSchemesListTheValidOnes) {
  for (const char* source : {"", ":", "nothing", "nothing:here", "TUM:dir", "/some/folder"}) {
    expect_refused(source, ErrorKind::bad_usage, "tum:DIR, sevenscenes:DIR, synthetic:SCENE");
  }
}

TEST(Registry, SchemesOfOtherBuildsSaySo) {
  const auto source = open_source("oni:/nowhere/a.oni", {});
  ASSERT_FALSE(source);
  if (source.error_kind() == ErrorKind::bad_usage)
    EXPECT_TRUE(contains(source.error(), "is not part of this build")) << source.error();
  else
    EXPECT_TRUE(contains(source.error(), "/nowhere/a.oni")) << source.error();
}

TEST(Registry, VideoNodesThatAreNotThereCannotBeOpened) {
  expect_refused("v4l2:/dev/video98", ErrorKind::bad_usage, "--camera");
  SourceOptions options;
  options.camera.camera = CameraModel{{525, 525, 319.5f, 239.5f, 0, 0}, {}};
  const auto source = open_source("v4l2:/dev/video98,/dev/video99", options);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error_kind(), ErrorKind::cannot_open);
  EXPECT_TRUE(contains(source.error(), "/dev/video98: No such file")) << source.error();
}

TEST(Registry, LogsThatAreNotThereCannotBeOpened) {
  expect_refused("log:/nowhere/log-000001.lcm", ErrorKind::cannot_open, "there is no such file");
}

TEST(Registry, SchemesWithoutTheRestSayWhatIsExpected) {
  expect_refused("tum", ErrorKind::bad_usage, "expected tum:DIR");
  expect_refused("tum:", ErrorKind::bad_usage, "expected tum:DIR");
  expect_refused("synthetic:", ErrorKind::bad_usage, "expected synthetic:SCENE");
}

TEST(Registry, MissingFoldersCannotBeOpened) {
  expect_refused("tum:/no/such/folder", ErrorKind::cannot_open, "/no/such/folder");
  expect_refused("sevenscenes:/no/such/folder", ErrorKind::cannot_open, "/no/such/folder");
}

}  // namespace
}  // namespace stillmap
