#include "drivers/dataset/tum_source.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <random>

#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/support/tiny_dataset.hpp"

namespace stillmap {
namespace {

using test::contains;
using test::FrameMemory;
using test::TempDir;

/// A folder with the images 0, 1, 2 and intrinsics, without lists.
class TumSource : public ::testing::Test {
 protected:
  void SetUp() override {
    test::write_tum_images(dir, 3);
    test::write_text(dir / "camera.toml", test::kTinyCamera);
  }
  void associate(const std::string& lines) { test::write_text(dir / "associated.txt", lines); }
  std::unique_ptr<FrameSource> open() {
    Result<std::unique_ptr<FrameSource>> source = open_tum(dir.path(), options);
    EXPECT_TRUE(source) << source.error();
    return source ? std::move(*source) : nullptr;
  }
  std::string error_of_open(ErrorKind kind = ErrorKind::cannot_open) {
    const Result<std::unique_ptr<FrameSource>> source = open_tum(dir.path(), options);
    EXPECT_FALSE(source);
    if (source) return "(none)";
    EXPECT_EQ(source.error_kind(), kind) << source.error();
    EXPECT_FALSE(contains(source.error(), "\n")) << source.error();
    return source.error();
  }

  TempDir dir;
  DatasetOptions options;
};

constexpr const char* kDepthFirst =
    "1.0 depth/0.png 1.01 rgb/0.png\n1.1 depth/1.png 1.11 rgb/1.png\n1.2 depth/2.png 1.21 rgb/2.png\n";

/// All frames are there, with the pixels of image `i` in frame `i`.
void expect_three_good_frames(FrameSource& source) {
  EXPECT_EQ(source.info().frames, 3);
  FrameMemory buffer(source.info());
  for (uint32_t i = 0; i < 3; ++i) {
    ASSERT_EQ(source.next(buffer.frame, 0), Status::ok) << source.error();
    EXPECT_EQ(buffer.frame.sequence, i);
    EXPECT_EQ(buffer.frame.depth_stamp.ns, 1000000000 + 100000000 * static_cast<int64_t>(i));
    EXPECT_EQ(buffer.frame.depth_raw.at(3, 5),
              test::depth_pattern(test::kTinyRows, test::kTinyCols, i).view().at(3, 5));
    EXPECT_EQ(buffer.frame.colour.at(3, 5).r,
              test::colour_pattern(test::kTinyRows, test::kTinyCols, i).view().at(3, 5).r);
  }
  EXPECT_EQ(source.next(buffer.frame, 0), Status::end);
  EXPECT_EQ(source.next(buffer.frame, 0), Status::end);
}

TEST_F(TumSource, ReadsAssociatedWithDepthFirst) {
  associate(kDepthFirst);
  const auto source = open();
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().name, "tum:" + dir.path());
  EXPECT_EQ(source->info().camera.k.width, test::kTinyCols);
  EXPECT_EQ(source->info().camera.k.height, test::kTinyRows);
  EXPECT_EQ(source->info().camera.k.fx, 20.0f);
  EXPECT_EQ(source->info().depth_units_per_m, 5000.0f);
  EXPECT_FALSE(source->info().has_truth_mask);
  expect_three_good_frames(*source);
}

TEST_F(TumSource, ReadsAssociatedWithColourFirst) {
  associate(
      "# rgb depth\n1.01 rgb/0.png 1.0 depth/0.png\n\n1.11 rgb/1.png 1.1 depth/1.png\r\n1.21 rgb/2.png 1.2 "
      "depth/2.png");
  const auto source = open();
  ASSERT_TRUE(source);
  expect_three_good_frames(*source);
}

TEST_F(TumSource, TellsTheColumnsByTheImagesWhenNamesDoNot) {
  for (int i = 0; i < 3; ++i) {
    const std::string name = std::to_string(i) + ".png";
    std::filesystem::rename(dir / ("depth/" + name), dir / ("a/" + name));
    std::filesystem::rename(dir / ("rgb/" + name), dir / ("b/" + name));
  }
  associate("1.01 b/0.png 1.0 a/0.png\n1.11 b/1.png 1.1 a/1.png\n1.21 b/2.png 1.2 a/2.png\n");
  auto source = open();
  ASSERT_TRUE(source);
  expect_three_good_frames(*source);
  associate("1.0 a/0.png 1.01 b/0.png\n1.1 a/1.png 1.11 b/1.png\n1.2 a/2.png 1.21 b/2.png\n");
  source = open();
  ASSERT_TRUE(source);
  expect_three_good_frames(*source);
  associate("1.0 a/0.png 1.01 a/1.png\n");
  EXPECT_TRUE(contains(error_of_open(), "which column is depth"));
}

TEST_F(TumSource, PairsTwoListsByStamp) {
  test::write_text(dir / "depth.txt",
                   "# depth\n1.0 depth/0.png\n1.1 depth/1.png\n1.2 depth/2.png\n1.3 depth/3.png\n");
  test::write_text(dir / "rgb.txt",
                   "0.9 rgb/9.png\n1.02 rgb/0.png\n1.095 rgb/1.png\n1.19 rgb/2.png\n1.321 rgb/3.png\n");
  const auto source = open();
  ASSERT_TRUE(source);
  expect_three_good_frames(*source);
}

TEST_F(TumSource, AddsTheOffsetToColourBeforePairing) {
  test::write_text(dir / "depth.txt", "1.0 depth/0.png\n1.1 depth/1.png\n1.2 depth/2.png\n");
  test::write_text(dir / "rgb.txt", "1.05 rgb/0.png\n1.15 rgb/1.png\n1.25 rgb/2.png\n");
  EXPECT_TRUE(contains(error_of_open(), "none of 3 depth and 3 colour images lie within 0.020000 s"));
  options.time_offset_ms = -50;
  const auto source = open();
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(buffer.frame.colour_stamp.ns, 1000000000);
}

TEST_F(TumSource, AnOffsetPairsTheColumnsOfAssociatedAnew) {
  associate(kDepthFirst);
  options.time_offset_ms = 90;  // colour 0 moves to 1.1, onto depth 1
  const auto source = open();
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().frames, 2);
  FrameMemory buffer(source->info());
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(buffer.frame.depth_stamp.ns, 1100000000);
  EXPECT_EQ(buffer.frame.colour_stamp.ns, 1100000000);
  EXPECT_EQ(buffer.frame.colour.at(3, 5).r,
            test::colour_pattern(test::kTinyRows, test::kTinyCols, 0).view().at(3, 5).r);
}

TEST_F(TumSource, StampsAreExact) {
  associate("1305031229.597000123 depth/0.png 1305031229.5970 rgb/0.png\n");
  const auto source = open();
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(buffer.frame.depth_stamp.ns, 1305031229597000123);
  EXPECT_EQ(buffer.frame.colour_stamp.ns, 1305031229597000000);
}

TEST_F(TumSource, TruthIsTheNearestPoseWithinTwentyMs) {
  associate(kDepthFirst);
  test::write_text(
      dir / "groundtruth.txt",
      "# stamp tx ty tz qx qy qz qw\n1.005 1 2 3 0 0 0 2\n0.99 9 9 9 0 0 0 1\n1.1 1 1 1 0 0 0 0\n"
      "1.1 nan 0 0 0 0 0 1\n1.179 0 0 0 0 0 0 1\nrubbish\n");
  const auto source = open();
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  ASSERT_TRUE(buffer.frame.truth_T_world_cam);
  EXPECT_EQ(buffer.frame.truth_T_world_cam->translation.y, 2.0);
  EXPECT_EQ(buffer.frame.truth_T_world_cam->rotation(0, 0), 1.0);
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_FALSE(buffer.frame.truth_T_world_cam) << "a zero quaternion and NaN are no truth";
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_FALSE(buffer.frame.truth_T_world_cam) << "21 ms away";
}

TEST_F(TumSource, SkipPassesOverFrames) {
  associate(kDepthFirst);
  const auto source = open();
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  source->skip(2);
  ASSERT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(buffer.frame.sequence, 2u);
  source->skip(std::numeric_limits<uint32_t>::max());
  EXPECT_EQ(source->next(buffer.frame, 0), Status::end);
}

// --- bad input
// -----------------------------------------------------------------------------------------------------

/// Three frames of which only the one in the middle is bad.
void expect_only_the_middle_bad(FrameSource& source, const std::string& message) {
  FrameMemory buffer(source.info());
  EXPECT_EQ(source.next(buffer.frame, 0), Status::ok) << source.error();
  EXPECT_EQ(source.error(), "");
  EXPECT_EQ(source.next(buffer.frame, 0), Status::bad_data);
  EXPECT_EQ(buffer.frame.sequence, 1u);
  EXPECT_TRUE(contains(source.error(), message)) << source.error();
  EXPECT_EQ(source.next(buffer.frame, 0), Status::ok) << source.error();
  EXPECT_EQ(buffer.frame.sequence, 2u);
  EXPECT_EQ(source.next(buffer.frame, 0), Status::end);
}

TEST_F(TumSource, MissingImageSpoilsOneFrame) {
  associate(kDepthFirst);
  std::filesystem::remove(dir / "rgb/1.png");
  const auto source = open();
  ASSERT_TRUE(source);
  expect_only_the_middle_bad(*source, "rgb/1.png: cannot be read: No such file");
}

TEST_F(TumSource, TruncatedImageSpoilsOneFrame) {
  associate(kDepthFirst);
  std::filesystem::resize_file(dir / "depth/1.png", 100);
  const auto source = open();
  ASSERT_TRUE(source);
  expect_only_the_middle_bad(*source, "depth/1.png: not a whole PNG image");
}

TEST_F(TumSource, WrongSizeSpoilsOneFrame) {
  associate(kDepthFirst);
  ASSERT_TRUE(write_png16(dir / "depth/1.png", test::depth_pattern(8, 8).view()));
  const auto source = open();
  ASSERT_TRUE(source);
  expect_only_the_middle_bad(*source, "depth/1.png: expected 16x12 pixels, found 8x8 pixels");
}

TEST_F(TumSource, StampThatJumpsBackSpoilsOneFrame) {
  associate("1.0 depth/0.png 1.0 rgb/0.png\n0.5 depth/1.png 0.5 rgb/1.png\n1.2 depth/2.png 1.2 rgb/2.png\n");
  auto source = open();
  ASSERT_TRUE(source);
  expect_only_the_middle_bad(*source, "stamp 0.500000 jumps back: expected more than 1.000000");
  associate("1.0 depth/0.png 1.0 rgb/0.png\n1.0 depth/1.png 1.0 rgb/1.png\n1.2 depth/2.png 1.2 rgb/2.png\n");
  source = open();
  ASSERT_TRUE(source);
  expect_only_the_middle_bad(*source, "jumps back");
}

TEST_F(TumSource, OneStrayStampAheadDoesNotSpoilTheRest) {
  associate(
      "1.0 depth/0.png 1.0 rgb/0.png\n99 depth/1.png 99 rgb/1.png\n1.2 depth/2.png 1.2 rgb/2.png\n"
      "1.3 depth/2.png 1.3 rgb/2.png\n");
  const auto source = open();
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  EXPECT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(source->next(buffer.frame, 0), Status::bad_data);
  EXPECT_TRUE(contains(source->error(), "99.000000 lies ahead")) << source->error();
  EXPECT_EQ(source->next(buffer.frame, 0), Status::ok);
  EXPECT_EQ(source->next(buffer.frame, 0), Status::ok);
}

TEST_F(TumSource, LineThatCannotBeUnderstoodSpoilsOneFrame) {
  associate("1.0 depth/0.png 1.0 rgb/0.png\n1.1 depth/1.png oops\n1.2 depth/2.png 1.2 rgb/2.png\n");
  const auto source = open();
  ASSERT_TRUE(source);
  expect_only_the_middle_bad(*source, "associated.txt:2: expected stamp file stamp file");
}

TEST_F(TumSource, EmptyAssociationIsAnError) {
  associate("# nothing\n\n");
  EXPECT_TRUE(contains(error_of_open(), "associated.txt: has no line"));
  associate("");
  EXPECT_TRUE(contains(error_of_open(), "associated.txt: has no line"));
}

TEST_F(TumSource, FolderWithoutListsIsAnError) {
  EXPECT_TRUE(contains(error_of_open(), "neither associated.txt nor depth.txt and rgb.txt"));
  test::write_text(dir / "depth.txt", "1.0 depth/0.png\n");
  EXPECT_TRUE(contains(error_of_open(), "neither associated.txt"));
  test::write_text(dir / "rgb.txt", "\n");
  EXPECT_TRUE(contains(error_of_open(), "rgb.txt: has no line"));
}

TEST_F(TumSource, MissingFolderIsAnError) {
  const Result<std::unique_ptr<FrameSource>> source = open_tum(dir.path() + "/none", {});
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error_kind(), ErrorKind::cannot_open);
}

TEST_F(TumSource, NoReadableDepthImageIsAnError) {
  associate("1.0 depth/7.png 1.0 rgb/0.png\n1.1 depth/8.png 1.1 rgb/1.png\n");
  EXPECT_TRUE(
      contains(error_of_open(), "no depth image can be read; the first: " + dir.path() + "/depth/7.png"));
  associate("1.0 depth/a.png 1.0 rgb/0.png\n");
  test::write_colour(dir / "depth/a.png");
  EXPECT_TRUE(contains(error_of_open(), "expected a depth image of 16-bit grey"));
}

TEST_F(TumSource, FirstDepthImageMayBeMissing) {
  associate(kDepthFirst);
  std::filesystem::remove(dir / "depth/0.png");
  const auto source = open();
  ASSERT_TRUE(source);
  FrameMemory buffer(source->info());
  EXPECT_EQ(source->next(buffer.frame, 0), Status::bad_data);
  EXPECT_EQ(source->next(buffer.frame, 0), Status::ok);
}

TEST_F(TumSource, UnknownIntrinsicsAreBadUsage) {
  associate(kDepthFirst);
  std::filesystem::remove(dir / "camera.toml");
  EXPECT_TRUE(contains(error_of_open(ErrorKind::bad_usage), "intrinsics are not known"));
}

TEST_F(TumSource, CentreOutsideTheImageIsBadUsage) {
  associate(kDepthFirst);
  test::write_text(dir / "camera.toml", "fx = 20.0\nfy = 21.0\ncx = 320.0\ncy = 6.0\n");
  EXPECT_TRUE(contains(error_of_open(ErrorKind::bad_usage), "camera.toml: centre cx = 320.0"));
}

TEST_F(TumSource, OptionsThatAreNotFiniteAreBadUsage) {
  associate(kDepthFirst);
  options.time_offset_ms = std::numeric_limits<double>::quiet_NaN();
  error_of_open(ErrorKind::bad_usage);
  options.time_offset_ms = 0;
  options.max_pair_ms = -1;
  error_of_open(ErrorKind::bad_usage);
}

/// Outside bytes: frames or an error, never a crash.
TEST_F(TumSource, MutatedListsNeverCrash) {
  constexpr uint32_t kSeed = 5;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  int opened = 0, frames = 0, bad = 0;
  for (int round = 0; round < 400; ++round) {
    std::string text = kDepthFirst;
    for (size_t change = 0, changes = 1 + random() % 5; change < changes; ++change) {
      const size_t at = random() % text.size();
      switch (random() % 4) {
        case 0:
          text[at] = static_cast<char>(random());
          break;
        case 1:
          text.erase(at, 1 + random() % 10);
          break;
        case 2:
          text.insert(at, 1, "0123456789.e- \n#/"[random() % 17]);
          break;
        default:
          text.insert(at, text.substr(random() % text.size(), 30));
      }
      if (text.empty()) text.push_back('\n');
    }
    associate(text);
    options.time_offset_ms = round % 3 == 0 ? 15 : 0;
    Result<std::unique_ptr<FrameSource>> source = open_tum(dir.path(), options);
    if (!source) {
      EXPECT_FALSE(source.error().empty());
      continue;
    }
    ++opened;
    FrameMemory buffer((*source)->info());
    for (int i = 0; i < 50; ++i) {
      const Status status = (*source)->next(buffer.frame, 0);
      if (status == Status::end) break;
      frames += status == Status::ok;
      bad += status == Status::bad_data;
      EXPECT_EQ(status == Status::bad_data, !(*source)->error().empty());
    }
    EXPECT_EQ((*source)->next(buffer.frame, 0), Status::end);
  }
  EXPECT_GT(opened, 50);
  EXPECT_GT(frames, 100);
  EXPECT_GT(bad, 50);
}

}  // namespace
}  // namespace stillmap
