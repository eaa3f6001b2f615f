#include "config/validate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "config/fields.hpp"

namespace stillmap {
namespace {

bool mentions(const std::vector<std::string>& lines, const std::string& part) {
  return std::any_of(lines.begin(), lines.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

/// The violations of the defaults after one change.
template <class Change>
std::vector<std::string> after(Change change) {
  Config config;
  change(config);
  return violations(config);
}

TEST(Validate, DefaultsAreFine) {
  const auto found = violations(Config{});
  EXPECT_TRUE(found.empty()) << found.front();
}

TEST(Validate, ListsEveryViolationWithKeyValueAndLimit) {
  const auto found = after([](Config& c) {
    c.track.levels = 7;
    c.mask.gamma = -1;
    c.map.high_water = 2;
    c.runtime.threads = 0;
  });
  EXPECT_EQ(found.size(), 4u);
  EXPECT_TRUE(mentions(found, "track.levels = 7: allowed 1 to 3"));
  EXPECT_TRUE(mentions(found, "mask.gamma = -1.0: allowed 0 to 1"));
  EXPECT_TRUE(mentions(found, "map.high_water = 2.0: allowed 0.1 to 1"));
  EXPECT_TRUE(mentions(found, "runtime.threads = 0: allowed 1 to 64"));
}

/// Each number of each section, just outside both ends of its range.
TEST(Validate, EveryRangeIsChecked) {
  Config names;
  int checked = 0;
  for_each_field(names, [&](const Field& wanted, auto& example) {
    using T = std::remove_cvref_t<decltype(example)>;
    if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
      for (const bool high : {false, true}) {
        Config config;
        for_each_field(config, [&](const Field& field, auto& value) {
          using V = std::remove_cvref_t<decltype(value)>;
          if constexpr (std::is_same_v<V, T>) {
            if (field.name() != wanted.name()) return;
            if constexpr (std::is_same_v<T, float>)
              value = high ? std::nextafter(static_cast<float>(field.highest),
                                            std::numeric_limits<float>::infinity())
                           : std::nextafter(static_cast<float>(field.lowest),
                                            -std::numeric_limits<float>::infinity());
            else
              value = static_cast<int32_t>(high ? field.highest : field.lowest) + (high ? 1 : -1);
          }
        });
        EXPECT_TRUE(mentions(violations(config), wanted.name() + " = ")) << wanted.name();
        ++checked;
      }
    }
  });
  EXPECT_GT(checked, 60);
}

TEST(Validate, TheMountIsAPose) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.mount.T_body_cam[6] = 3; }),
                       "mount.T_body_cam: the length of the quaternion"));
}

void good_sonar(Config& c) {
  c.sonar.kind = SonarKind::hc_sr04;
  c.sonar.trigger_line = 5;
  c.sonar.echo_line = 6;
}

/// The violations of a good sonar after one change.
template <class Change>
std::vector<std::string> sonar_after(Change change) {
  return after([&](Config& c) {
    good_sonar(c);
    change(c.sonar);
  });
}

TEST(Validate, TheSonarFitsTogether) {
  EXPECT_TRUE(after(good_sonar).empty());
  EXPECT_TRUE(sonar_after([](SonarConfig& s) { s.stop_line = 7; }).empty());
  EXPECT_TRUE(sonar_after([](SonarConfig& s) {
                s.kind = SonarKind::pulse_width;
                s.trigger_line = -1;
                s.max_m = 7;
              }).empty());
  const auto only = [](const std::vector<std::string>& found, const std::string& text) {
    EXPECT_EQ(found.size(), 1u) << text;
    EXPECT_TRUE(mentions(found, text)) << (found.empty() ? "nothing" : found.front());
  };
  only(sonar_after([](SonarConfig& s) { s.chip.clear(); }), "sonar.chip");
  only(sonar_after([](SonarConfig& s) { s.echo_line = -1; }), "sonar.echo_line = -1");
  only(sonar_after([](SonarConfig& s) { s.trigger_line = -1; }), "needs a trigger line");
  only(sonar_after([](SonarConfig& s) { s.kind = SonarKind::pulse_width; }), "no effect with sonar.kind");
  only(sonar_after([](SonarConfig& s) { s.trigger_line = s.echo_line; }), "is sonar.trigger_line as well");
  only(sonar_after([](SonarConfig& s) { s.stop_line = s.echo_line; }), "is sonar.echo_line as well");
  only(sonar_after([](SonarConfig& s) { s.min_m = s.max_m; }), "must be below sonar.max_m = 4.0");
  only(sonar_after([](SonarConfig& s) { s.stop_m = 5; }), "sonar.stop_m = 5.0");
  only(sonar_after([](SonarConfig& s) { s.stop_line = 7, s.stop_m = 0.01f; }), "never says stop");
  only(sonar_after([](SonarConfig& s) { s.max_m = 12; }), "allowed below 12.5");
  only(sonar_after([](SonarConfig& s) { s.rate_hz = 1, s.lost_s = 1, s.max_age_s = 1; }),
       "sonar.lost_s = 1.0");
  only(sonar_after([](SonarConfig& s) { s.rate_hz = 1.5f; }), "sonar.max_age_s = 0.25");
  only(sonar_after([](SonarConfig& s) { s.T_cam_sonar[6] = 2; }), "sonar.T_cam_sonar");
  only(after([](Config& c) { c.sonar.stop_line = 7; }), "no effect while sonar.kind is none");
}

TEST(Validate, EndsOfARangeAreAllowed) {
  EXPECT_TRUE(after([](Config& c) { c.depth.min_m = 0.01f; }).empty());
  EXPECT_TRUE(after([](Config& c) { c.map.high_water = 0.1f; }).empty());
  EXPECT_TRUE(after([](Config& c) { c.mask.flood_depth_ratio = 0.1f; }).empty());
}

TEST(Validate, NaNIsAViolation) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.mask.gamma = std::numeric_limits<float>::quiet_NaN(); }),
                       "mask.gamma"));
}

TEST(Validate, DepthRangeMustNotBeEmpty) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.depth.min_m = 5.0f; }),
                       "depth.min_m = 5.0: must be below depth.max_m"));
}

TEST(Validate, TruncationIsFourToTwentyFourVoxels) {
  EXPECT_TRUE(after([](Config& c) { c.map.truncation_m = 0.04f; }).empty());
  EXPECT_TRUE(after([](Config& c) { c.map.truncation_m = 0.24f; }).empty());
  const auto thin = after([](Config& c) { c.map.truncation_m = 0.0399f; });
  EXPECT_TRUE(mentions(thin, "map.truncation_m = 0.0399: allowed 0.04 to 0.24"));
  EXPECT_TRUE(mentions(after([](Config& c) { c.map.truncation_m = 0.241f; }), "map.truncation_m"));
}

TEST(Validate, PoorIsNotBelowLost) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.track.poor_inlier_ratio = 0.1f; }),
                       "track.poor_inlier_ratio = 0.1: must be at least track.lost_inlier_ratio = 0.2"));
}

TEST(Validate, InlierBandIsInsideTheTruncationBand) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.track.inlier_m = 0.1f; }), "track.inlier_m"));
}

TEST(Validate, SomeLevelMustIterate) {
  EXPECT_TRUE(mentions(after([](Config& c) {
                         c.track.levels = 1;
                         c.track.iterations_fine = 0;
                       }),
                       "track.iterations_fine = 0"));
  EXPECT_TRUE(after([](Config& c) { c.track.iterations_fine = 0; }).empty());
}

TEST(Validate, CameraIsGivenWholeOrNotAtAll) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.camera.fx = 500; }), "camera.fy = 0.0"));
  EXPECT_TRUE(mentions(after([](Config& c) { c.camera.k1 = 0.1f; }), "camera.k1 = 0.1: has no effect"));
  EXPECT_TRUE(after([](Config& c) {
                c.camera.fx = c.camera.fy = 500;
                c.camera.cx = 320;
                c.camera.cy = 240;
                c.camera.k1 = 0.1f;
              }).empty());
}

TEST(Validate, WaitIsForeverOrNotNegative) {
  EXPECT_TRUE(after([](Config& c) { c.source.wait_s = -1; }).empty());
  EXPECT_TRUE(mentions(after([](Config& c) { c.source.wait_s = -0.5f; }), "source.wait_s = -0.5"));
}

TEST(Validate, MapOnTheWayNeedsAMap) {
  EXPECT_TRUE(after([](Config& c) { c.record.map = true, c.record.map_every_s = 60; }).empty());
  EXPECT_TRUE(mentions(after([](Config& c) { c.record.map_every_s = 60; }), "record.map_every_s = 60.0"));
}

TEST(Validate, TheLogHasRoomForTwoFilesAndFramesNeedIt) {
  EXPECT_TRUE(mentions(after([](Config& c) { c.record.log_max_bytes = 1.9f * c.record.log_file_bytes; }),
                       "must be at least twice record.log_file_bytes"));
  EXPECT_TRUE(mentions(after([](Config& c) { c.record.frames = true; }), "record.log is false"));
}

TEST(Validate, WhatIsTakenAsFarIsOutOfRange) {
  EXPECT_TRUE(after([](Config& c) { c.depth.invalid = InvalidDepth::complete; }).empty());
  EXPECT_TRUE(mentions(after([](Config& c) {
                         c.depth.invalid = InvalidDepth::complete;
                         c.depth.far_m = c.depth.max_m;
                       }),
                       "must be above depth.max_m"));
  EXPECT_TRUE(after([](Config& c) { c.depth.far_m = 1; }).empty()) << "not used";
}

TEST(CameraProblem, NamesWhatIsWrong) {
  const CameraModel good = {{500, 500, 320, 240, 640, 480}, {}};
  EXPECT_EQ(camera_problem(good), "");
  const auto problem = [&](auto change) {
    CameraModel camera = good;
    change(camera);
    return camera_problem(camera);
  };
  EXPECT_NE(problem([](CameraModel& c) { c.k.fx = std::numeric_limits<float>::quiet_NaN(); }), "");
  EXPECT_NE(problem([](CameraModel& c) { c.distortion.k3 = std::numeric_limits<float>::infinity(); }), "");
  EXPECT_NE(problem([](CameraModel& c) { c.k.fy = 0; }), "");
  EXPECT_NE(problem([](CameraModel& c) { c.k.fx = -500; }), "");
  EXPECT_NE(problem([](CameraModel& c) { c.k.cx = 640; }), "");
  EXPECT_NE(problem([](CameraModel& c) { c.k.cy = -1; }), "");
  EXPECT_EQ(problem([](CameraModel& c) {
              c.k.width = c.k.height = 0;
              c.k.cx = 9000;
            }),
            "");
}

}  // namespace
}  // namespace stillmap
