#include "drivers/dataset/intrinsics.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using test::TempDir;

constexpr const char* kMatrix = "5.85e+02 0 3.2e+02\n0 5.86e+02 2.4e+02\n0 0 1\n";

TEST(Intrinsics, KnownFoldersHaveTheirPublishedCalibration) {
  const auto fr1 = camera_by_folder_name("rgbd_dataset_freiburg1_rpy");
  ASSERT_TRUE(fr1);
  EXPECT_EQ(fr1->k.fx, 517.306408f);
  EXPECT_EQ(fr1->k.cy, 255.313989f);
  EXPECT_EQ(fr1->distortion.k3, 1.163314f);
  const auto fr2 = camera_by_folder_name("FREIBURG2_desk");
  ASSERT_TRUE(fr2);
  EXPECT_EQ(fr2->k.fy, 521.007327f);
  EXPECT_EQ(fr2->distortion.p2, -0.000105f);
  const auto fr3 = camera_by_folder_name("rgbd_dataset_freiburg3_walking_xyz");
  ASSERT_TRUE(fr3);
  EXPECT_EQ(fr3->k.cx, 320.106653f);
  EXPECT_TRUE(fr3->distortion.none());
  const auto bonn = camera_by_folder_name("rgbd_bonn_balloon");
  ASSERT_TRUE(bonn);
  EXPECT_EQ(bonn->k.fx, 542.822841f);
  EXPECT_EQ(bonn->distortion.k2, -0.099343f);
  EXPECT_EQ(bonn->distortion.k3, 0.0f);
  EXPECT_FALSE(camera_by_folder_name("kitchen"));
}

TEST(Intrinsics, OrderIsOptionFileMatrixNameDefault) {
  const TempDir dir;
  const std::string folder = (dir / "freiburg1/x").substr(0, dir.path().size() + 10);
  DatasetOptions options;
  const CameraDefaults defaults = {CameraModel{{1, 1, 1, 1, 0, 0}, {}}, 5000};
  EXPECT_EQ(find_camera(folder, options, defaults)->model.k.fx, 517.306408f);
  EXPECT_EQ(find_camera(folder + "/", options, defaults)->model.k.fx, 517.306408f);
  EXPECT_EQ(find_camera(dir.path(), options, defaults)->model.k.fx, 1.0f);
  test::write_text(folder + "/camera-intrinsics.txt", kMatrix);
  EXPECT_EQ(find_camera(folder, options, defaults)->model.k.fy, 586.0f);
  test::write_text(folder + "/camera.toml", "depth_scale = 1000\n");  // says nothing of the lens
  EXPECT_EQ(find_camera(folder, options, defaults)->model.k.fy, 586.0f);
  EXPECT_EQ(find_camera(folder, options, defaults)->depth_units_per_m, 1000.0f);
  test::write_text(folder + "/camera.toml", "fx=1.5\nfy=2\ncx=3\ncy=4\ndistortion=[0.1,0.2,0.3,0.4,0.5]\n");
  const Result<DatasetCamera> from_file = find_camera(folder, options, defaults);
  ASSERT_TRUE(from_file) << from_file.error();
  EXPECT_EQ(from_file->model.k.fx, 1.5f);
  EXPECT_EQ(from_file->model.distortion.p2, 0.4f);
  EXPECT_EQ(from_file->depth_units_per_m, 5000.0f);
  options.camera = CameraModel{{700, 701, 320, 240, 0, 0}, {}};
  options.depth_units_per_m = 2000;
  EXPECT_EQ(find_camera(folder, options, defaults)->model.k.fx, 700.0f);
  EXPECT_EQ(find_camera(folder, options, defaults)->depth_units_per_m, 2000.0f);
}

TEST(Intrinsics, WithoutAnyTheErrorSaysWhatToDo) {
  const TempDir dir;
  const Result<DatasetCamera> none = find_camera(dir.path(), {}, {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error_kind(), ErrorKind::bad_usage);
  EXPECT_NE(none.error().find("--camera"), std::string::npos) << none.error();
  EXPECT_NE(none.error().find(dir.path()), std::string::npos) << none.error();
}

TEST(Intrinsics, NumbersWithoutSenseAreErrors) {
  const TempDir dir;
  for (const char* text :
       {"fx=0\nfy=1\ncx=1\ncy=1", "fx=-5\nfy=1\ncx=1\ncy=1", "fx=nan\nfy=1\ncx=1\ncy=1",
        "fx=1e300\nfy=1\ncx=1\ncy=1", "fx=1\nfy=1\ncx=1", "fx=1\nfy=1\ncx=1\ncy=1\ndepth_scale=0"}) {
    test::write_text(dir / "camera.toml", text);
    const Result<DatasetCamera> camera = find_camera(dir.path(), {}, {});
    ASSERT_FALSE(camera) << text;
    EXPECT_EQ(camera.error_kind(), ErrorKind::bad_usage);
    EXPECT_NE(camera.error().find("camera.toml"), std::string::npos) << camera.error();
  }
  test::write_text(dir / "camera.toml", "");
  for (const char* text : {"", "1 2 3", "nan 0 1\n0 1 1\n0 0 1", "0 0 1\n0 1 1\n0 0 1", "1 0 1\n0 1 1\n0 0 2",
                           "1 0 1\n0 1 1\n0 0 1 7", "a 0 1\n0 1 1\n0 0 1"}) {
    test::write_text(dir / "camera-intrinsics.txt", text);
    const Result<DatasetCamera> camera = find_camera(dir.path(), {}, {});
    ASSERT_FALSE(camera) << text;
    EXPECT_NE(camera.error().find("camera-intrinsics.txt"), std::string::npos) << camera.error();
  }
  DatasetOptions options;
  options.camera = CameraModel{{500, 0, 320, 240, 0, 0}, {}};
  EXPECT_FALSE(find_camera(dir.path(), options, {}));
  options.camera = CameraModel{{500, 500, 320, 240, 0, 0}, {}};
  options.depth_units_per_m = -1;
  EXPECT_FALSE(find_camera(dir.path(), options, {}));
  options.depth_units_per_m = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(find_camera(dir.path(), options, {}));
}

}  // namespace
}  // namespace stillmap
