#include "config/load.hpp"

#include <gtest/gtest.h>

#include <random>

#include "config/describe.hpp"
#include "config/fields.hpp"
#include "config/validate.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using test::contains;

std::string error_of(const std::string& toml) {
  const Result<Config> config = parse_config(toml, "test.toml");
  if (config) return "(none)";
  EXPECT_EQ(config.error_kind(), ErrorKind::bad_usage);
  return config.error();
}

TEST(Load, EmptyFileGivesTheDefaults) {
  const Result<Config> config = parse_config("", "test.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(to_toml(*config), to_toml(Config{}));
}

TEST(Load, ReadsEveryKindOfValue) {
  const Result<Config> config = parse_config(
      "[depth]\nmin_m = 1\ninvalid = \"complete\"\n[track]\nlevels = 2\nprior = \"constant_velocity\"\n"
      "damping_initial = 1e-3\n[mask]\nenabled = false\n",
      "test.toml");
  ASSERT_TRUE(config) << config.error();
  EXPECT_EQ(config->depth.min_m, 1.0f);
  EXPECT_EQ(config->depth.invalid, InvalidDepth::complete);
  EXPECT_EQ(config->track.levels, 2);
  EXPECT_EQ(config->track.prior, MotionPrior::constant_velocity);
  EXPECT_EQ(config->track.damping_initial, 1e-3f);
  EXPECT_FALSE(config->mask.enabled);
}

TEST(Load, UnknownKeyNamesFileLineKeyAndTheNearest) {
  const std::string error = error_of("[track]\n\ncolour_wieght = 0.1\n");
  EXPECT_TRUE(contains(error, "test.toml:3: ")) << error;
  EXPECT_TRUE(contains(error, "track.colour_wieght")) << error;
  EXPECT_TRUE(contains(error, "did you mean track.colour_weight?")) << error;
}

TEST(Load, UnknownSectionNamesTheNearest) {
  const std::string error = error_of("[tracks]\nlevels = 2\n");
  EXPECT_TRUE(contains(error, "test.toml:1: ")) << error;
  EXPECT_TRUE(contains(error, "did you mean [track]?")) << error;
  EXPECT_TRUE(contains(error_of("levels = 2\n"), "levels"));
}

TEST(Load, WrongTypesAreErrors) {
  EXPECT_TRUE(contains(error_of("[track]\nlevels = 2.5"), "track.levels: expected a whole number"));
  EXPECT_TRUE(contains(error_of("[track]\nlevels = \"2\""), "track.levels: expected a whole number"));
  EXPECT_TRUE(contains(error_of("[depth]\nmin_m = \"1\""), "depth.min_m: expected a number"));
  EXPECT_TRUE(contains(error_of("[depth]\nmin_m = true"), "depth.min_m: expected a number"));
  EXPECT_TRUE(contains(error_of("[mask]\nenabled = 1"), "mask.enabled: expected true or false"));
  EXPECT_TRUE(contains(error_of("[depth]\ninvalid = 1"), "depth.invalid: expected one of ignore|complete"));
  EXPECT_TRUE(contains(error_of("[depth]\ninvalid = \"skip\""), "expected one of ignore|complete"));
  EXPECT_TRUE(contains(error_of("[depth]\nmin_m = [1, 2]"), "depth.min_m: expected a number"));
  EXPECT_TRUE(contains(error_of("depth = 3"), "depth is a section"));
  EXPECT_TRUE(contains(error_of("[[depth]]\nmin_m = 1"), "depth is a section"));
}

TEST(Load, NumbersThatAreNotFiniteOrDoNotFitAreErrors) {
  EXPECT_TRUE(contains(error_of("[depth]\nmin_m = nan"), "depth.min_m: expected a finite number"));
  EXPECT_TRUE(contains(error_of("[depth]\nmin_m = inf"), "depth.min_m: expected a finite number"));
  EXPECT_TRUE(contains(error_of("[depth]\nmin_m = 1e300"), "depth.min_m: expected a finite number"));
  EXPECT_TRUE(contains(error_of("[track]\nlevels = 9000000000"), "track.levels: expected a whole number"));
}

TEST(Load, ListsEveryProblemOfAFile) {
  const std::string error = error_of("[track]\nlevles = 2\nprior = \"wheels\"\n[maps]\n");
  EXPECT_TRUE(contains(error, "track.levles")) << error;
  EXPECT_TRUE(contains(error, "track.prior")) << error;
  EXPECT_TRUE(contains(error, "maps")) << error;
}

TEST(Load, ListsHaveTheirLength) {
  const Result<Config> config = parse_config("[mount]\nT_body_cam = [0.1, 2, 3, 0, 0, 0, 1]\n", "test.toml");
  ASSERT_TRUE(config) << config.error();
  EXPECT_EQ(config->mount.T_body_cam, (std::array<float, 7>{0.1f, 2, 3, 0, 0, 0, 1}));
  for (const char* list : {"[0, 0, 0, 0, 0, 1]", "[0, 0, 0, 0, 0, 0, 0, 1]", "3", "[0, 0, 0, 0, 0, 0, nan]",
                           "[0, 0, 0, 0, 0, 0, \"1\"]"}) {
    const std::string error = error_of(std::string("[mount]\nT_body_cam = ") + list);
    EXPECT_TRUE(contains(error, "mount.T_body_cam: expected")) << list << error;
  }
}

TEST(ApplySetting, TakesLists) {
  Config config;
  for (const char* text : {"1,2,3,0,0,0,1", "[1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]"}) {
    config.mount = {};
    const Result<Done> done = apply_setting(config, std::string("mount.T_body_cam=") + text);
    EXPECT_TRUE(done) << done.error();
    EXPECT_EQ(config.mount.T_body_cam, (std::array<float, 7>{1, 2, 3, 0, 0, 0, 1})) << text;
  }
  for (const char* text :
       {"", "1,2,3", "1,2,3,0,0,0,1,", "1,2,3,0,0,0,1,2", "[1,2,3,0,0,0,1", "1,,3,0,0,0,1"})
    EXPECT_FALSE(apply_setting(config, std::string("mount.T_body_cam=") + text)) << text;
  EXPECT_EQ(config.mount.T_body_cam[0], 1.0f);
}

TEST(Load, BrokenTomlNamesFileAndLine) {
  const std::string error = error_of("[track]\nlevels = = 2\n");
  EXPECT_TRUE(contains(error, "test.toml:2: not valid TOML")) << error;
  EXPECT_TRUE(contains(error_of("[track]\nlevels = 2\nlevels = 3\n"), "test.toml:3")) << error;
}

TEST(Load, MissingFileAndFolderAreErrors) {
  const test::TempDir dir;
  const Result<Config> missing = load_config(dir / "none.toml");
  ASSERT_FALSE(missing);
  EXPECT_TRUE(contains(missing.error(), "none.toml: cannot be read: No such file")) << missing.error();
  const Result<Config> folder = load_config(dir.path());
  ASSERT_FALSE(folder);
  EXPECT_TRUE(contains(folder.error(), "expected a file")) << folder.error();
}

TEST(ApplySetting, SetsValuesOfEveryKind) {
  Config config;
  for (const char* setting :
       {"record.masks=true", "track.levels=1", "depth.max_m=4.5", "depth.invalid=complete",
        "track.prior=\"constant_velocity\"", "source.time_offset_ms=-20", "map.voxel_m=+2e-2"}) {
    const Result<Done> done = apply_setting(config, setting);
    EXPECT_TRUE(done) << done.error();
  }
  EXPECT_TRUE(config.record.masks);
  EXPECT_EQ(config.track.levels, 1);
  EXPECT_EQ(config.depth.max_m, 4.5f);
  EXPECT_EQ(config.depth.invalid, InvalidDepth::complete);
  EXPECT_EQ(config.track.prior, MotionPrior::constant_velocity);
  EXPECT_EQ(config.source.time_offset_ms, -20.0f);
  EXPECT_EQ(config.map.voxel_m, 0.02f);
}

TEST(ApplySetting, RefusesAndLeavesTheConfigurationAlone) {
  Config config;
  for (const char* setting : {"",
                              "=",
                              ".",
                              ".=",
                              "track",
                              "track.levels",
                              "track.levels=",
                              "track=1",
                              "track.levels=two",
                              "track.levels=2 ",
                              "track.levels=2.0",
                              "depth.min_m=nan",
                              "depth.min_m=inf",
                              "depth.min_m=0.1m",
                              "depth.min_m=1e999",
                              "mask.enabled=1",
                              "mask.enabled=True",
                              "depth.invalid=",
                              "depth.invalid=\"",
                              "nothing.here=1",
                              "track.levels=99999999999999999999"}) {
    const Result<Done> done = apply_setting(config, setting);
    EXPECT_FALSE(done) << setting;
    if (!done) {
      EXPECT_TRUE(contains(done.error(), setting));
      EXPECT_EQ(done.error_kind(), ErrorKind::bad_usage);
    }
  }
  EXPECT_EQ(to_toml(config), to_toml(Config{}));
  const Result<Done> unknown = apply_setting(config, "record.mask=true");
  ASSERT_FALSE(unknown);
  EXPECT_TRUE(contains(unknown.error(), "did you mean record.masks?")) << unknown.error();
}

/// Outside bytes: whatever they are, there is a configuration or an error, never a crash.
TEST(Load, MutatedFilesNeverCrash) {
  constexpr uint32_t kSeed = 20240611;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const std::string valid = to_toml(Config{});
  const auto below = [&](size_t n) { return static_cast<size_t>(random()) % n; };
  int accepted = 0, refused = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string text = valid;
    for (size_t change = 0, changes = 1 + below(8); change < changes; ++change) {
      const size_t at = below(text.size());
      switch (below(4)) {
        case 0:
          text[at] = static_cast<char>(below(256));
          break;
        case 1:
          text.erase(at, 1 + below(40));
          break;
        case 2:
          text.insert(at, text.substr(below(text.size()), below(40)));
          break;
        default:
          text.insert(at, 1, "[]{}=\".,#\n\\"[below(11)]);
      }
    }
    const Result<Config> config = parse_config(text, "mutated");
    if (config) {
      ++accepted;
      EXPECT_LE(violations(*config).size(), 200u);
    } else {
      ++refused;
      EXPECT_FALSE(config.error().empty());
    }
  }
  EXPECT_GT(accepted, 100);  // the mutations reach both sides
  EXPECT_GT(refused, 100);
}

TEST(Load, DeepNestingIsAnError) {
  EXPECT_NE(error_of("[track]\nlevels = " + std::string(100000, '[')), "(none)");
}

}  // namespace
}  // namespace stillmap
