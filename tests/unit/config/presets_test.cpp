// The files in config/presets against the program. Tests run in the root of the sources.
// `STILLMAP_RENEW_PRESETS=1 build/release/test_config --gtest_filter='Presets.*'` writes default.toml anew.

#include <gtest/gtest.h>

#include <cstdlib>
#include <set>
#include <sstream>

#include "config/describe.hpp"
#include "config/fields.hpp"
#include "config/load.hpp"
#include "config/validate.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

constexpr const char* kDefault = "config/presets/default.toml";
constexpr const char* kPaper = "config/presets/paper.toml";
constexpr const char* kPaperTum = "config/presets/paper_tum.toml";
constexpr const char* kRenew =
    "renew it with: STILLMAP_RENEW_PRESETS=1 build/release/test_config --gtest_filter='Presets.*'";

/// The keys that a TOML file sets, as "section.key".
std::set<std::string> keys_set_in(const std::string& path) {
  std::set<std::string> keys;
  std::string section;
  std::istringstream lines(test::read_text(path));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('[')) section = line.substr(1, line.find(']') - 1);
    const size_t equals = line.find(" = ");
    if (!line.starts_with('#') && equals != std::string::npos)
      keys.insert(section + "." + line.substr(0, equals));
  }
  return keys;
}

Config load(const char* path) {
  const Result<Config> config = load_config(path);
  EXPECT_TRUE(config) << config.error();
  return config ? *config : Config{};
}

TEST(Presets, DefaultIsWhatTheProgramDoes) {
  if (std::getenv("STILLMAP_RENEW_PRESETS")) test::write_text(kDefault, to_toml(Config{}));
  EXPECT_EQ(test::read_text(kDefault), to_toml(Config{})) << kRenew;
  EXPECT_EQ(to_toml(load(kDefault)), to_toml(Config{}));
}

TEST(Presets, DefaultHoldsEveryKeyOfEverySection) {
  const std::set<std::string> present = keys_set_in(kDefault);
  Config config;
  for_each_field(config, [&](const Field& field, auto& /*value*/) {
    EXPECT_TRUE(present.contains(field.name())) << field.name();
  });
  EXPECT_TRUE(violations(load(kDefault)).empty());
}

TEST(Presets, PaperSetsEveryAlgorithmicKey) {
  for (const char* path : {kPaper, kPaperTum}) {
    const std::set<std::string> present = keys_set_in(path);
    const std::set<std::string> algorithmic = {"depth", "track", "mask", "integrate", "map"};
    Config config;
    for_each_field(config, [&](const Field& field, auto& /*value*/) {
      if (algorithmic.contains(field.section)) {
        EXPECT_TRUE(present.contains(field.name())) << path << " " << field.name();
      }
    });
  }
}

TEST(Presets, PaperHasThePapersTableOfParameters) {
  const Config paper = load(kPaper);
  EXPECT_TRUE(violations(paper).empty());
  EXPECT_EQ(paper.map.voxel_m, 0.01f);
  EXPECT_EQ(paper.map.truncation_m, 0.1f);
  EXPECT_EQ(paper.track.colour_weight, 0.025f);
  EXPECT_EQ(paper.mask.flood_depth_ratio, 0.007f);
  EXPECT_EQ(paper.mask.gamma, 0.5f);
}

TEST(Presets, PaperTakesWhatTheDesignSaysWhereThePaperIsSilent) {
  const Config paper = load(kPaper);
  EXPECT_EQ(paper.depth.min_m, 0.1f);
  EXPECT_EQ(paper.depth.max_m, 5.0f);
  EXPECT_EQ(paper.depth.invalid, InvalidDepth::ignore);
  EXPECT_EQ(paper.track.prior, MotionPrior::last_pose);
  EXPECT_EQ(paper.track.huber_depth_m, 0.02f);
  EXPECT_EQ(paper.track.levels, 3);
  EXPECT_EQ(paper.track.iterations_coarse, 6);
  EXPECT_EQ(paper.track.iterations_middle, 3);
  EXPECT_EQ(paper.track.iterations_fine, 2);
  EXPECT_EQ(paper.track.settled_m, 0.0f);
  EXPECT_TRUE(paper.mask.enabled);
  EXPECT_EQ(paper.mask.erode_px, 15);
  EXPECT_EQ(paper.mask.dilate_px, 10);
  EXPECT_TRUE(paper.integrate.free_space);
  EXPECT_EQ(paper.integrate.weight_cap, 64);
  EXPECT_EQ(paper.map.pool_blocks, 400000);
  EXPECT_EQ(paper.memory.budget_mb, 2048);
}

TEST(Presets, PaperTumIsPaperWithCompletion) {
  Config expected = load(kPaper);
  expected.depth.invalid = InvalidDepth::complete;
  expected.depth.complete_frames = 10;
  const Config paper_tum = load(kPaperTum);
  EXPECT_EQ(to_toml(paper_tum), to_toml(expected));
  EXPECT_TRUE(violations(paper_tum).empty());
}

TEST(Describe, ReadsBackToTheSameValues) {
  Config config;
  config.depth.min_m = 0.123456789f;
  config.depth.invalid = InvalidDepth::complete;
  config.track.damping_initial = 3.0000001e-7f;
  config.track.prior = MotionPrior::constant_velocity;
  config.mask.enabled = false;
  config.map.pool_blocks = 1234567;
  config.source.time_offset_ms = -20;
  const Result<Config> again = parse_config(to_toml(config), "described");
  ASSERT_TRUE(again) << again.error();
  EXPECT_EQ(again->depth.min_m, config.depth.min_m);
  EXPECT_EQ(again->track.damping_initial, config.track.damping_initial);
  EXPECT_EQ(to_toml(*again), to_toml(config));
}

TEST(Describe, SaysUnitRangePaperAndPurpose) {
  const std::string text = to_toml(Config{});
  EXPECT_NE(text.find("gamma = 0.5                    # 0 to 1; Tab. I, Eq. (5); a squared residual"),
            std::string::npos);
  EXPECT_NE(text.find("prior = \"constant_velocity\"    # last_pose|constant_velocity|odometry; ours;"),
            std::string::npos);
  EXPECT_NE(text.find("# true or false; III-C; false: everything"), std::string::npos);
}

}  // namespace
}  // namespace stillmap
