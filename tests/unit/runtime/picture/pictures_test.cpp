#include "runtime/picture/pictures.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "runtime/picture/canvas.hpp"
#include "runtime/picture/run_data.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

constexpr double kStart_s = 1305031229.4331;
constexpr int kFrames = 60;

/// A tiny run: an arc, off by a centimetre here and there, some poor and lost frames, two snapshots, a floor
/// with a box.
class Pictures : public ::testing::Test {
 protected:
  void write_trajectories() {
    std::string truth, estimate;
    for (int i = 0; i < kFrames; ++i) {
      const double t = i / 30.0, x = std::sin(t), z = 1 - std::cos(t), off = 0.01 * ((i / 10) % 2);
      truth += fmt::format("{:.6f} {} 0 {} 0 0 0 1\n", kStart_s + t, x, z);
      estimate += fmt::format("{:.6f} {} {} {} 0 0.01 0 1\n", kStart_s + t, x, off, z);
    }
    dir_.write("truth.txt", truth);
    dir_.write("trajectory.txt", estimate);
  }
  void write_states() {
    std::string states = "stamp,state,p_good,inlier_ratio,masked_fraction,cov_x_x\n";
    for (int i = 0; i < kFrames; ++i)
      states += fmt::format("{:.6f},{},0.9,0.8,{},1e-6\n", kStart_s + i / 30.0,
                            i < 30   ? "good"
                            : i < 40 ? "poor"
                                     : "lost",
                            0.1 + 0.001 * i);
    dir_.write("states.csv", states);
  }
  void write_timing() {
    std::string timing = "stamp,prepare_ms,track_ms,mask_ms,refine_ms,integrate_ms,total_ms\n";
    for (int i = 0; i < kFrames; ++i) timing += fmt::format("{},20,20,20,20,20,101\n", i);
    dir_.write("timing.csv", timing);
  }
  void write_snapshots() {
    for (const char* stamp : {"1305031229.433100", "1305031230.433100"}) {
      Canvas colour(64, 48), mask(64, 48), map(64, 48);
      colour.fill({0, 0, 64, 48}, {0, 0, 1, 1});
      mask.fill({0, 0, 64, 48}, {0, 0, 0, 1});
      mask.fill({0, 0, 32, 48}, {1, 1, 1, 1});
      map.fill({0, 0, 64, 48}, {0, 1, 0, 1});
      std::filesystem::create_directories(dir_.path("snapshots"));
      const std::string base = dir_.path("snapshots/") + stamp;
      ASSERT_TRUE(colour.write_png(base + "_colour.png"));
      ASSERT_TRUE(mask.write_png(base + "_mask.png"));
      ASSERT_TRUE(map.write_png(base + "_map.png"));
    }
  }
  void write_mesh() {
    std::string vertices, faces, cloud;
    constexpr int kSide = 41;
    for (int i = 0; i < kSide; ++i)
      for (int j = 0; j < kSide; ++j) {
        const std::string at =
            fmt::format("{} 1 {}", -1 + 0.05 * i, 1 + 0.05 * j);  // the floor, 1 m below the camera
        vertices += at + " 220 40 160\n";
        cloud += at + "\n";
        const int n = i * kSide + j;
        if (i + 1 < kSide && j + 1 < kSide)
          faces +=
              fmt::format("3 {} {} {}\n3 {} {} {}\n", n, n + kSide, n + kSide + 1, n, n + kSide + 1, n + 1);
      }
    const std::string head = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n",
        kSide * kSide);
    dir_.write("mesh.ply",
               head + "property uchar red\nproperty uchar green\nproperty uchar blue\n" +
                   fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                               2 * (kSide - 1) * (kSide - 1)) +
                   vertices + faces);
    dir_.write("truth_cloud.ply", head + "end_header\n" + cloud);
  }
  void write_everything() {
    write_trajectories();
    write_states();
    write_timing();
    write_snapshots();
    write_mesh();
  }

  std::vector<PictureOutcome> make(const PictureOptions& options = {}) {
    auto outcomes = make_pictures(dir_.path(""), options);
    EXPECT_TRUE(outcomes);
    return outcomes ? *outcomes : std::vector<PictureOutcome>{};
  }
  PictureOutcome outcome_of(const std::string& name) {
    for (const PictureOutcome& outcome : make())
      if (outcome.name == name) return outcome;
    return {};
  }
  Picture picture(const std::string& name) {
    const auto read = read_picture(dir_.path("pictures/" + name));
    EXPECT_TRUE(read) << (read ? "" : read.error());
    return read ? *read : Picture{};
  }

  test::TempDir dir_;
};

bool near(Rgb8 p, Colour colour, int tolerance = 12) {
  return std::abs(p.r - 255 * colour.r) <= tolerance && std::abs(p.g - 255 * colour.g) <= tolerance &&
         std::abs(p.b - 255 * colour.b) <= tolerance;
}

/// Pixels of that colour inside a part of the picture.
int count(const Picture& picture, Colour colour, const Rect& part) {
  int found = 0;
  for (int row = static_cast<int>(part.y);
       row < std::min<int>(picture.height, static_cast<int>(part.y + part.height)); ++row)
    for (int col = static_cast<int>(part.x);
         col < std::min<int>(picture.width, static_cast<int>(part.x + part.width)); ++col)
      found += near(picture.at(row, col), colour) ? 1 : 0;
  return found;
}

Colour on_white(Colour c) {
  return {1 + (c.r - 1) * c.a, 1 + (c.g - 1) * c.a, 1 + (c.b - 1) * c.a, 1};
}

TEST_F(Pictures, AllAreMadeAndAre1200Wide) {
  write_everything();
  for (const PictureOutcome& outcome : make()) {
    EXPECT_EQ(outcome.state, PictureState::written) << outcome.name << ": " << outcome.why;
    const Picture page = picture(outcome.name);
    EXPECT_EQ(page.width, 1200) << outcome.name;
    EXPECT_GT(page.height, 250) << outcome.name;
    EXPECT_FALSE(std::filesystem::exists(dir_.path("pictures/" + outcome.name + ".part")));
  }
}

TEST_F(Pictures, TrajectoryShowsTruthAndEstimateInBothViews) {
  write_trajectories();
  make();
  const Picture page = picture("trajectory.png");
  for (const Rect& view : {Rect{80, 160, 360, 420}, Rect{680, 160, 360, 420}}) {  // beside the legends
    EXPECT_GT(count(page, kTruthColour, view), 20);
    EXPECT_GT(count(page, kEstimateColour, view), 20);
  }
}

TEST_F(Pictures, TruthMayBeGivenByName) {
  write_trajectories();
  std::filesystem::rename(dir_.path("truth.txt"), dir_.path("other.txt"));
  make();
  EXPECT_LT(count(picture("trajectory.png"), kTruthColour, {80, 160, 360, 420}), 20);
  make({dir_.path("other.txt")});
  EXPECT_GT(count(picture("trajectory.png"), kTruthColour, {80, 160, 360, 420}), 20);
}

TEST_F(Pictures, ErrorShadesPoorAndLostFrames) {
  write_trajectories();
  write_states();
  make();
  const Picture page = picture("error.png");
  EXPECT_EQ(page.height, 44 + 3 * 270);
  // Half of the frames are good, then a sixth poor, a third lost; the axes reach from 74 to 1182.
  const Rect good = {80, 600, 500, 180}, poor = {640, 600, 90, 180}, lost = {840, 600, 330, 180};
  EXPECT_EQ(count(page, on_white(kPoorColour), good) + count(page, on_white(kLostColour), good), 0);
  EXPECT_GT(count(page, on_white(kPoorColour), poor), 10'000);
  EXPECT_GT(count(page, on_white(kLostColour), lost), 30'000);
}

TEST_F(Pictures, ErrorWithoutTruthShowsTheMaskedShareAlone) {
  write_states();
  EXPECT_EQ(outcome_of("error.png").state, PictureState::written);
  EXPECT_EQ(picture("error.png").height, 44 + 270);
}

TEST_F(Pictures, FramesShowMaskInRedAndTheMapBeside) {
  write_snapshots();
  EXPECT_EQ(outcome_of("frames.png").state, PictureState::written);
  const Picture page = picture("frames.png");
  const int row = 76 + 100;  // inside the first row of images
  const Rgb8 masked = page.at(row, 50), free = page.at(row, 250), map = page.at(row, 400);
  EXPECT_GT(masked.r, 80);  // red over the camera's blue
  EXPECT_GT(masked.b, 100);
  EXPECT_LT(free.r, 10);
  EXPECT_GT(free.b, 240);
  EXPECT_GT(map.g, 240);
  EXPECT_GT(count(page, {235 / 255.0, 30 / 255.0, 40 / 255.0, 1}, {10, 76, 290, 200}), 100);  // the rim
}

TEST_F(Pictures, FramesWithoutMaskOrMapAreStillShown) {
  write_snapshots();
  std::filesystem::remove(dir_.path("snapshots/1305031229.433100_mask.png"));
  std::filesystem::remove(dir_.path("snapshots/1305031229.433100_map.png"));
  EXPECT_EQ(outcome_of("frames.png").state, PictureState::written);
  EXPECT_LT(picture("frames.png").at(176, 50).r, 10);
}

TEST_F(Pictures, TimingStacksTheStages) {
  write_timing();
  EXPECT_EQ(outcome_of("timing.png").state, PictureState::written);
  const Picture page = picture("timing.png");
  // Five stages of 20 ms each from the bottom (510) up; the axis is 1.2 x 101 ms over 432 pixels.
  const auto at_ms = [&](double ms) { return page.at(static_cast<int>(510 - ms / (1.2 * 101) * 432), 600); };
  const double expected[5][3] = {
      {0.55, 0.75, 0.90}, {0.20, 0.50, 0.80}, {0.90, 0.45, 0.40}, {0.35, 0.70, 0.45}, {0.95, 0.75, 0.35}};
  for (int stage = 0; stage < 5; ++stage)
    EXPECT_TRUE(near(at_ms(10 + 20 * stage), {expected[stage][0], expected[stage][1], expected[stage][2]}))
        << stage;
}

TEST_F(Pictures, MapShowsTheFloorFromAboveAndFromBehind) {
  write_mesh();
  EXPECT_EQ(outcome_of("map.png").state, PictureState::written);
  const Picture page = picture("map.png");
  for (const int col : {10 + 292, 605 + 292}) {  // the middle of each view
    const Rgb8 middle = page.at(72 + 280, col);
    EXPECT_GT(middle.r, 120);
    EXPECT_LT(middle.g, 60);
    EXPECT_GT(middle.b, 80);
  }
}

TEST_F(Pictures, SaysWhatIsMissing) {
  write_timing();
  const std::vector<PictureOutcome> outcomes = make();
  ASSERT_EQ(outcomes.size(), 6u);
  for (const PictureOutcome& outcome : outcomes) {
    if (outcome.name == "timing.png") continue;
    EXPECT_EQ(outcome.state, PictureState::skipped) << outcome.name;
    EXPECT_NE(outcome.why.find(dir_.path("")), std::string::npos) << outcome.why;
    EXPECT_FALSE(std::filesystem::exists(dir_.path("pictures/" + outcome.name)));
  }
  EXPECT_NE(outcome_of("trajectory.png").why.find("trajectory.txt"), std::string::npos);
  EXPECT_NE(outcome_of("cumulative.png").why.find("mesh.ply"), std::string::npos);
  EXPECT_NE(outcome_of("frames.png").why.find("snapshots"), std::string::npos);
}

TEST_F(Pictures, AnEmptyFolderGivesNoneAndStaysEmpty) {
  for (const PictureOutcome& outcome : make()) EXPECT_EQ(outcome.state, PictureState::skipped);
  EXPECT_FALSE(std::filesystem::exists(dir_.path("pictures")));
  EXPECT_FALSE(make_pictures(dir_.path("missing")));
}

TEST_F(Pictures, BrokenInputsAreErrorsThatNameTheFile) {
  write_everything();
  const std::pair<const char*, const char*> broken[] = {
      {"trajectory.txt", "trajectory.png"},
      {"states.csv", "error.png"},
      {"timing.csv", "timing.png"},
      {"mesh.ply", "map.png"},
      {"truth_cloud.ply", "cumulative.png"},
      {"snapshots/1305031229.433100_colour.png", "frames.png"},
      {"snapshots/1305031229.433100_mask.png", "frames.png"},
      {"snapshots/1305031229.433100_map.png", "frames.png"}};
  for (const auto& [input, name] : broken) {
    const std::string good = test::read_text(dir_.path(input));
    for (const std::string& bad :
         {std::string("garbage,\x01\x02"), good.substr(0, good.size() / 2) + "\n?", std::string()}) {
      dir_.write(input, bad);
      const PictureOutcome outcome = outcome_of(name);
      EXPECT_EQ(outcome.state, PictureState::failed) << input << " of " << bad.size() << " bytes";
      EXPECT_NE(outcome.why.find(input), std::string::npos) << outcome.why;
    }
    dir_.write(input, good);
  }
}

TEST_F(Pictures, ABlankFirstLineIsNoHeader) {
  dir_.write("timing.csv", "\n1,2,3,4,5,6,7\n");
  const PictureOutcome outcome = outcome_of("timing.png");
  EXPECT_EQ(outcome.state, PictureState::failed);
  EXPECT_NE(outcome.why.find("timing.csv:2: has no column"), std::string::npos) << outcome.why;
}

TEST_F(Pictures, AMaskOfAnotherSizeIsAnError) {
  write_snapshots();
  ASSERT_TRUE(Canvas(32, 48).write_png(dir_.path("snapshots/1305031229.433100_mask.png")));
  const PictureOutcome outcome = outcome_of("frames.png");
  EXPECT_EQ(outcome.state, PictureState::failed);
  EXPECT_NE(outcome.why.find("32 x 48"), std::string::npos) << outcome.why;
}

TEST_F(Pictures, OneFrameIsEnough) {
  dir_.write("trajectory.txt", "1 0 0 0 0 0 0 1\n");
  dir_.write("truth.txt", "1 5 5 5 0 0 0 1\n");
  dir_.write("states.csv", "stamp,state,p_good,inlier_ratio,masked_fraction\n1,lost,0,0,1\n");
  dir_.write("timing.csv",
             "stamp,prepare_ms,track_ms,mask_ms,refine_ms,integrate_ms,total_ms\n1,0,0,0,0,0,0\n");
  for (const char* name : {"trajectory.png", "error.png", "timing.png"})
    EXPECT_EQ(outcome_of(name).state, PictureState::written) << name;
}

TEST(ReadPicture, ALieAboutTheSizeCostsNothing) {
  test::TempDir dir;
  std::string png("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x7f\xff\0\0\x7f\xff", 24);
  const auto read = read_picture(dir.write("big.png", png));
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().find("64 million"), std::string::npos) << read.error();
}

TEST(WritePng, SaysWhyItCannot) {
  test::TempDir dir;
  const auto written = Canvas(10, 10).write_png(dir.path("no/such/folder.png"));
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().find("folder.png"), std::string::npos);
}

}  // namespace
}  // namespace stillmap
