#include "drivers/synthetic/spec.hpp"

#include <gtest/gtest.h>

namespace stillmap::synthetic {
namespace {

TEST(Spec, defaults_are_the_scenes_own) {
  const auto spec = parse_spec("loop");
  ASSERT_TRUE(spec);
  EXPECT_STREQ(spec->scene->name, "loop");
  EXPECT_FALSE(spec->without_movers);
  EXPECT_EQ(spec->seed, 1u);
  EXPECT_EQ(spec->width, 640);
  EXPECT_EQ(spec->height, 480);
  EXPECT_EQ(spec->seconds, spec->scene->default_seconds);
}

TEST(Spec, options_come_in_any_order) {
  const auto spec = parse_spec("crowd-static,seconds=2.5,seed=18446744073709551615,size=1920x1080");
  ASSERT_TRUE(spec);
  EXPECT_STREQ(spec->scene->name, "crowd");
  EXPECT_TRUE(spec->without_movers);
  EXPECT_EQ(spec->seed, 18446744073709551615ull);
  EXPECT_EQ(spec->width, 1920);
  EXPECT_EQ(spec->height, 1080);
  EXPECT_EQ(spec->seconds, 2.5);
}

TEST(Spec, every_scene_has_a_twin) {
  for (const Scene& scene : all_scenes()) {
    const auto twin = parse_spec(std::string(scene.name) + "-static");
    ASSERT_TRUE(twin) << scene.name;
    EXPECT_TRUE(twin->without_movers);
    EXPECT_STREQ(twin->scene->name, scene.name);
    EXPECT_GE(scene.default_seconds, 10.0);
  }
}

TEST(Spec, unknown_scene_lists_the_known_ones) {
  for (const char* text :
       {"", "balloons", "crowd-moving", "-static", "Crowd", "crowd ", "crowd-static-static"}) {
    const auto spec = parse_spec(text);
    ASSERT_FALSE(spec) << text;
    EXPECT_NE(spec.error().find("placing_obstructing_box"), std::string::npos) << spec.error();
    EXPECT_NE(spec.error().find(std::string("'") + text + "'"), std::string::npos) << spec.error();
    EXPECT_EQ(spec.error().find('\n'), std::string::npos);
  }
}

TEST(Spec, bad_options_name_themselves_and_what_is_valid) {
  for (const char* option : {"",
                             "seed",
                             "seed=",
                             "seed=-1",
                             "seed=1.5",
                             "seed=18446744073709551616",
                             "size=640",
                             "size=640x",
                             "size=63x48",
                             "size=64x47",
                             "size=1921x480",
                             "size=640x1081",
                             "size=640x480x3",
                             "size=-640x480",
                             "seconds=0",
                             "seconds=-3",
                             "seconds=nan",
                             "seconds=inf",
                             "seconds=1e9",
                             "seconds=ten",
                             "fps=30",
                             "=3",
                             "seed=1 "}) {
    const auto spec = parse_spec(std::string("crowd,") + option);
    ASSERT_FALSE(spec) << option;
    EXPECT_NE(spec.error().find(std::string("'") + option + "'"), std::string::npos) << spec.error();
    EXPECT_NE(spec.error().find("size=WxH"), std::string::npos) << spec.error();
  }
  EXPECT_FALSE(parse_spec("crowd,seed=1,seed=2"));
  EXPECT_FALSE(parse_spec("crowd,seed=1,"));
}

}  // namespace
}  // namespace stillmap::synthetic
