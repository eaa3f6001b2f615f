#include "config/calibration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/contains.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

constexpr const char* kWhole =
    "depth_scale = 1000.0\ndepth_bias = [0.001, 0.99, 0.002]\n"
    "[colour]\nwidth = 640\nheight = 480\nfx = 500\nfy = 501.5\ncx = 320.0\ncy = 240\n"
    "distortion = [0.1, -0.2, 0, 0.001, 0.3]\n"
    "[depth]\nfx = 570\nfy = 571\ncx = 319\ncy = 239\nT_colour_depth = [-0.025, 0.001, 0.002, 0, 0, 0.1, "
    "0.995]\n";

std::string refused(const std::string& text, OtherKeys others = OtherKeys::refused) {
  const Result<Calibration> calibration = parse_calibration(text, "my.toml", others);
  if (calibration) return "(none)";
  EXPECT_EQ(calibration.error_kind(), ErrorKind::bad_usage);
  EXPECT_TRUE(test::contains(calibration.error(), "my.toml")) << calibration.error();
  return calibration.error();
}

TEST(Calibration, ReadsAllThatAFileCanSay) {
  const Result<Calibration> c = parse_calibration(kWhole, "my.toml");
  ASSERT_TRUE(c) << c.error();
  ASSERT_TRUE(c->colour);
  EXPECT_EQ(c->colour->k.width, 640);
  EXPECT_EQ(c->colour->k.height, 480);
  EXPECT_EQ(c->colour->k.fx, 500.0f);
  EXPECT_EQ(c->colour->k.fy, 501.5f);
  EXPECT_EQ(c->colour->k.cx, 320.0f);
  EXPECT_EQ(c->colour->k.cy, 240.0f);
  EXPECT_EQ(c->colour->distortion.k1, 0.1f);
  EXPECT_EQ(c->colour->distortion.p2, 0.001f);
  EXPECT_EQ(c->colour->distortion.k3, 0.3f);
  EXPECT_EQ(c->depth_units_per_m, 1000.0f);
  EXPECT_EQ(c->depth_bias.c[0], 0.001f);
  EXPECT_EQ(c->depth_bias.c[2], 0.002f);
  EXPECT_EQ(c->depth_bias.c[3], 0.0f);
  ASSERT_TRUE(c->depth);
  EXPECT_EQ(c->depth->model.k.fx, 570.0f);
  EXPECT_EQ(c->depth->model.k.width, 0) << "not said";
  EXPECT_NEAR(c->depth->T_colour_depth.translation.x, -0.025, 1e-7);
  // A turn about z by twice atan(0.1 / 0.995), whatever the rounding of the quaternion.
  EXPECT_NEAR(log_rotation(c->depth->T_colour_depth.rotation).z, 2 * std::atan(0.1 / 0.995), 1e-6);
}

TEST(Calibration, AllOfItMayBeLeftOut) {
  const Result<Calibration> c = parse_calibration("", "my.toml");
  ASSERT_TRUE(c);
  EXPECT_FALSE(c->colour);
  EXPECT_FALSE(c->depth);
  EXPECT_EQ(c->depth_units_per_m, 0.0f);
  EXPECT_TRUE(c->depth_bias.none());
}

TEST(Calibration, TheLensMayStandAlone) {
  const Result<Calibration> c = parse_calibration("fx = 500\nfy = 500\ncx = 320\ncy = 240\n", "my.toml");
  ASSERT_TRUE(c) << c.error();
  EXPECT_EQ(c->colour->k.fx, 500.0f);
}

TEST(Calibration, EveryKindOfBadFileIsRefusedWithKeyAndWhatWasExpected) {
  const std::pair<const char*, const char*> cases[] = {
      {"fx =", "not valid TOML"},
      {"fx = 500\n", "expected all of fx, fy, cx and cy"},
      {"distortion = [0.1, 0, 0, 0]", "expected all of fx, fy, cx and cy"},
      {"fx = nan\nfy = 1\ncx = 1\ncy = 1", "my.toml:1: fx: expected a finite number"},
      {"fx = \"5\"\nfy = 1\ncx = 1\ncy = 1", "fx: expected a finite number"},
      {"fx = true\nfy = 1\ncx = 1\ncy = 1", "fx: expected a finite number"},
      {"fx = 1e300\nfy = 1\ncx = 1\ncy = 1", "fx: expected a finite number"},
      {"fx = 0\nfy = 1\ncx = 1\ncy = 1", "fx = 0.0, fy = 1.0 must be above 0"},
      {"[colour]\nfx = 9\nfy = 9\ncx = 9\ncy = 9\nwidth = 640", "both width and height"},
      {"width = 0\n", "width: expected 1 to 4096 pixels"},
      {"height = 480.5\n", "height: expected 1 to 4096 pixels"},
      {"fx = 9\nfy = 9\ncx = 900\ncy = 9\nwidth = 640\nheight = 480", "lies outside the image of 640x480"},
      {"distortion = [1, 2]", "distortion: expected [k1, k2, p1, p2, k3]"},
      {"distortion = 3", "distortion: expected [k1, k2, p1, p2, k3]"},
      {"distortion = [1, 2, 3, \"4\"]", "distortion: expected a finite number"},
      {"distorsion = [0, 0, 0, 0]", "unknown key; did you mean distortion?"},
      {"k1 = 0.1", "expected distortion = [k1"},
      {"[colour]\nf_x = 1", "colour.f_x: unknown key; did you mean colour.fx?"},
      {"[color]\nfx = 1", "did you mean colour?"},
      {"colour = 3", "expected [colour] with keys below it"},
      {"depth_scale = 0", "depth_scale: expected units per metre, above 0"},
      {"depth_scale = -1", "depth_scale: expected units per metre, above 0"},
      {"depthscale = 1000", "did you mean depth_scale?"},
      {"depth_bias = 1.0", "depth_bias: expected [c0, c1]"},
      {"depth_bias = [1.0]", "depth_bias: expected [c0, c1]"},
      {"depth_bias = [0, 1, 0, 0, 0]", "depth_bias: expected [c0, c1]"},
      {"depth_bias = [0, inf]", "depth_bias: expected a finite number"},
      {"fx = 9\nfy = 9\ncx = 9\ncy = 9\n[colour]\nfx = 9\nfy = 9\ncx = 9\ncy = 9", "one of the two"},
      {"[depth]\nfx = 9\nfy = 9\ncx = 9\ncy = 9", "depth: expected fx, fy, cx, cy and T_colour_depth"},
      {"[depth]\nT_colour_depth = [0, 0, 0, 0, 0, 0, 1]", "depth: expected fx, fy, cx, cy and T_colour"},
      {"[depth]\nfx = 9\nfy = 9\ncx = 9\ncy = 9\nT_colour_depth = [0, 0, 0, 0, 0, 0, 1]",
       "of [colour] as well"},
      {"[depth]\nT_colour_depth = [0, 0, 0]", "depth.T_colour_depth: expected [x, y, z"},
      {"[depth]\nT_colour_depth = [0, 0, 0, 0, 0, 0, 2]", "unit quaternion of length 1"},
      {"T_colour_depth = [0, 0, 0, 0, 0, 0, 1]", "T_colour_depth: unknown key"},
  };
  for (const auto& [text, expected] : cases) {
    const std::string error = refused(text);
    EXPECT_TRUE(test::contains(error, expected)) << text << "\n" << error;
  }
}

TEST(Calibration, AllProblemsAreListed) {
  const std::string error = refused("depth_scale = 0\nfoo = 1\n[colour]\nfx = \"a\"\n");
  EXPECT_EQ(std::count(error.begin(), error.end(), '\n'), 2) << error;
}

// What stands in camera.toml of a recording besides is not ours to judge.
TEST(Calibration, BesideARecordingOtherKeysAreLetBe) {
  const std::string foreign =
      "name = \"mine\"\nwidth = 8\ndepth = \"png\"\n[colour]\nmodel = 3\n[other]\nfx = \"x\"\n";
  EXPECT_EQ(refused("fx = 9\nfy = 9\ncx = 9\ncy = 9\n" + foreign, OtherKeys::let_be), "(none)");
  for (const char* text : {"distorsion = [0, 0, 0, 0]", "k1 = 0.1", "depthscale = 1000", "fx = 500\n",
                           "depth_scale = nan", "depth_biass = [0, 1]"})
    EXPECT_NE(refused(text, OtherKeys::let_be), "(none)") << text;
}

TEST(Calibration, MutatedFilesNeverCrash) {
  constexpr uint32_t kSeed = 5;
  std::mt19937 random(kSeed);
  int read = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string text = kWhole;
    for (auto changes = 1 + random() % 3; changes > 0; --changes) {
      const size_t at = random() % text.size();
      if (random() % 2 == 0)
        text[at] = static_cast<char>(random() % 256);
      else
        text.erase(at, 1 + random() % 9);
    }
    const Result<Calibration> c = parse_calibration(text, "my.toml");
    if (c) ++read;
    EXPECT_TRUE(c || !c.error().empty());
  }
  EXPECT_GT(read, 30);
  EXPECT_LT(read, 2900);
}

TEST(ShippedCalibrations, AreFoundByTheirNameAndPlausible) {
  for (const char* name : {"xtion", "tum_freiburg1", "tum_freiburg2", "tum_freiburg3", "bonn"}) {
    const Result<std::string> file = find_calibration(name);
    ASSERT_TRUE(file) << file.error();
    const Result<Calibration> c = load_calibration(*file);
    ASSERT_TRUE(c) << c.error();
    ASSERT_TRUE(c->colour) << name;
    EXPECT_EQ(c->colour->k.width, 640);
    EXPECT_FALSE(c->depth) << "registered";
    EXPECT_TRUE(c->depth_bias.none());
    const auto lines = implausible(*c, name, 0, 0, DepthParams{});
    EXPECT_TRUE(lines.empty()) << lines.front();
  }
  EXPECT_EQ(load_calibration(*find_calibration("xtion"))->depth_units_per_m, 1000.0f);
  EXPECT_EQ(load_calibration(*find_calibration("bonn"))->depth_units_per_m, 5000.0f);
}

TEST(ShippedCalibrations, OneThatIsNotThereIsSaid) {
  const Result<std::string> file = find_calibration("xtoin");
  ASSERT_FALSE(file);
  EXPECT_TRUE(test::contains(file.error(), "calibrations/xtoin.toml")) << file.error();
  EXPECT_EQ(*find_calibration("./xtoin"), "./xtoin") << "a path";
  EXPECT_EQ(*find_calibration("xtoin.toml"), "xtoin.toml");
  EXPECT_FALSE(load_calibration("xtoin.toml"));
}

/// One line, with these words in it.
void expect_one(const std::vector<std::string>& lines, const std::string& words) {
  ASSERT_EQ(lines.size(), 1u) << words;
  EXPECT_TRUE(test::contains(lines[0], words)) << lines[0];
}

/// What is implausible of a good calibration after one change.
std::vector<std::string> spoilt(void (*change)(Calibration&)) {
  Calibration c = *parse_calibration(kWhole, "my.toml");
  change(c);
  return implausible(c, "my.toml", 640, 480, DepthParams{});
}

TEST(Implausible, ACalibrationAsItShouldBeIsNot) {
  EXPECT_TRUE(spoilt([](Calibration&) {}).empty());
}

TEST(Implausible, EachReasonIsGivenWithFileKeyValueAndExpectation) {
  expect_one(spoilt([](Calibration& c) { c.colour->k.fx = 180, c.colour->distortion = {}; }),
             "my.toml: colour.fx = 180.0: an angle of view of 121 degrees over the width of 640 pixels; "
             "expected 20 to 120");
  expect_one(spoilt([](Calibration& c) { c.depth->model.k.fy = 1400; }),
             "my.toml: depth.fy = 1400.0: an angle of view of 19 degrees over the height of 480");
  expect_one(spoilt([](Calibration& c) { c.colour->k.cx = 159; }),
             "my.toml: colour.cx = 159.0: expected within the middle half, 160.0 to 480.0");
  expect_one(spoilt([](Calibration& c) { c.depth->model.k.cy = 361; }), "depth.cy = 361.0");
  expect_one(spoilt([](Calibration& c) {
               c.colour->distortion = {-0.9f, 0, 0, 0, 0};
             }),
             "colour.distortion = [-0.9, 0.0, 0.0, 0.0, 0.0]: folds the image over");
  expect_one(spoilt([](Calibration& c) {
               c.depth->T_colour_depth.translation = {0.4, 0.3, 0.01};
             }),
             "depth.T_colour_depth: the cameras are 0.50");
  expect_one(spoilt([](Calibration& c) { c.depth_bias = {{0.0f, 1.11f, 0, 0}}; }), "depth_bias: makes");
  expect_one(spoilt([](Calibration& c) { c.depth_bias = {{0.05f, 1, 0, 0}}; }), "expected less than a tenth");
}

}  // namespace
}  // namespace stillmap
