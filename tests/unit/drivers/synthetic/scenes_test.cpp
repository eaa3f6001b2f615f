// What the scenes promise: how much moves, how fast the camera is, and that nothing passes through anything.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "drivers/synthetic/renderer.hpp"
#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/sensor_model.hpp"
#include "drivers/synthetic/sonar.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap::synthetic {
namespace {

constexpr Intrinsics kSceneCamera = {65.625f, 65.625f, 39.5f, 29.5f, 80, 60};
constexpr double kFrame_s = 1.0 / 30.0;

/// Shares of the pixels of one instant.
struct Shares {
  double t_s = 0;
  double moving = 0;       ///< of all pixels
  double still_valid = 0;  ///< of the pixels within the sensor's range
};

std::vector<Shares> shares_over(const Scene& scene, double step_s) {
  ThreadPool workers(2);
  Renderer renderer(kSceneCamera);
  IdealImages images;
  std::vector<Shares> all;
  for (double t = 0; t < scene.default_seconds; t += step_s) {
    renderer.render(world_at(scene, t, false), scene.camera(t), workers, images);
    int moving = 0, valid = 0, still = 0;
    for (size_t i = 0; i < images.mask.size(); ++i) {
      moving += images.mask[i] == kTrulyDynamic ? 1 : 0;
      if (images.depth_m[i] < kDepthMinM || images.depth_m[i] > kDepthMaxM) continue;
      ++valid;
      still += images.mask[i] != kTrulyDynamic ? 1 : 0;
    }
    all.push_back({t, static_cast<double>(moving) / static_cast<double>(images.mask.size()),
                   static_cast<double>(still) / std::max(valid, 1)});
  }
  return all;
}

double degrees_between(const Se3d& a, const Se3d& b) {
  return norm(log_rotation(transposed(a.rotation) * b.rotation)) * 57.29577951308232;
}

struct Pace {
  double m_per_s = 0, deg_per_s = 0, most_deg_per_frame = 0, most_m_per_frame = 0;
};

Pace pace_of(const Scene& scene) {
  Pace pace;
  const int frames = static_cast<int>(scene.default_seconds * 30.0) - 1;
  for (int i = 0; i < frames; ++i) {
    if (scene.covered != nullptr && scene.covered((i + 1) * kFrame_s)) continue;  // it may be carried off
    const Se3d a = scene.camera(i * kFrame_s), b = scene.camera((i + 1) * kFrame_s);
    const double metres = norm(b.translation - a.translation), degrees = degrees_between(a, b);
    pace.m_per_s += metres * 30.0 / frames;
    pace.deg_per_s += degrees * 30.0 / frames;
    pace.most_deg_per_frame = std::max(pace.most_deg_per_frame, degrees);
    pace.most_m_per_frame = std::max(pace.most_m_per_frame, metres);
  }
  return pace;
}

const Scene& scene_named(const char* name) {
  const Scene* scene = find_scene(name);
  EXPECT_NE(scene, nullptr) << name;
  return *scene;
}

class EveryScene : public testing::TestWithParam<const char*> {};

TEST_P(EveryScene, camera_is_brisk_but_smooth) {
  const Scene& scene = scene_named(GetParam());
  const Pace pace = pace_of(scene);
  EXPECT_TRUE(pace.m_per_s >= 0.2 || pace.deg_per_s >= 15.0)
      << pace.m_per_s << " m/s " << pace.deg_per_s << " deg/s";
  EXPECT_LT(pace.most_m_per_frame, 0.04);
  EXPECT_LT(pace.most_deg_per_frame, std::string(scene.name) == "fast" ? 7.5 : 3.0);
  // From rest: the second frame is almost the first.
  EXPECT_LT(norm(scene.camera(kFrame_s).translation - scene.camera(0).translation), 0.004);
}

TEST_P(EveryScene, movers_cover_15_percent_and_leave_enough_still) {
  const Scene& scene = scene_named(GetParam());
  const bool obstructs = std::string(scene.name).find("obstructing") != std::string::npos;
  const std::vector<Shares> shares = shares_over(scene, scene.default_seconds / 48.0);
  double moving = 0, least_still = 1;
  for (const Shares& s : shares) {
    moving += s.moving / static_cast<double>(shares.size());
    least_still = std::min(least_still, s.still_valid);
  }
  if (scene.dynamic) {
    EXPECT_GE(moving, 0.15);
    EXPECT_GE(least_still, obstructs ? 0.0 : 0.25);
  } else {
    EXPECT_EQ(moving, 0.0);
  }
}

TEST_P(EveryScene, starts_still_unless_it_must_not) {
  const Scene& scene = scene_named(GetParam());
  const std::string name = scene.name;
  const bool from_the_start = name == "crowd_start" || name == "person_tracking";
  ThreadPool workers(1);
  Renderer renderer(kSceneCamera);
  IdealImages images;
  for (double t = 0; t <= 1.0; t += 0.2) {
    renderer.render(world_at(scene, t, false), scene.camera(t), workers, images);
    const auto moving = static_cast<double>(std::count(images.mask.begin(), images.mask.end(), 255)) /
                        static_cast<double>(images.mask.size());
    if (from_the_start)
      EXPECT_GT(moving, 0.15) << t;
    else
      EXPECT_LT(moving, 0.03) << t;
  }
}

TEST_P(EveryScene, camera_keeps_clear_of_everything) {
  const Scene& scene = scene_named(GetParam());
  const float to_movers_m = std::string(scene.name) == "near" ? 0.16f : 0.6f;
  for (double t = 0; t < scene.default_seconds; t += 0.1) {
    const Vec3 lens = cast<float>(scene.camera(t)).translation;
    EXPECT_GT(lens.z, 1.1f);
    EXPECT_LT(lens.z, 1.6f);
    for (const Shape& shape : world_at(scene, t, false).shapes)
      ASSERT_GE(distance_m(shape, lens), shape.moving ? to_movers_m : 0.25f) << "at " << t << " s";
  }
}

TEST_P(EveryScene, movers_do_not_pass_through_furniture) {
  const Scene& scene = scene_named(GetParam());
  constexpr float kTouchM = 0.08f;  // hands on a box, shoes on the carpet
  for (double t = 0; t < scene.default_seconds; t += 0.2) {
    const World world = world_at(scene, t, false);
    for (const Shape& mover : world.shapes) {
      if (!mover.moving) continue;
      const bool capsule = mover.kind == Kind::capsule;
      const float radius =
          capsule ? mover.half_m.x : std::min({mover.half_m.x, mover.half_m.y, mover.half_m.z});
      for (const float end : {-1.0f, 0.0f, 1.0f}) {
        const Vec3 centre = mover.T_world_local * Vec3{0, 0, capsule ? end * mover.half_m.z : 0.0f};
        for (const Shape& still : world.shapes) {
          if (still.moving) continue;
          ASSERT_GT(distance_m(still, centre) - radius, -kTouchM) << "at " << t << " s";
        }
      }
    }
  }
}

TEST_P(EveryScene, nothing_jumps) {
  // The same shapes in the same order from frame to frame, each moved by little; hands and shoes are the
  // quickest.
  const Scene& scene = scene_named(GetParam());
  World before = world_at(scene, 0, false);
  for (double t = kFrame_s; t < scene.default_seconds; t += kFrame_s) {
    const World now = world_at(scene, t, false);
    ASSERT_EQ(now.shapes.size(), before.shapes.size());
    for (size_t i = 0; i < now.shapes.size(); ++i) {
      const float moved =
          norm(now.shapes[i].T_world_local.translation - before.shapes[i].T_world_local.translation);
      const bool limb = now.shapes[i].kind != Kind::box && now.shapes[i].half_m.x < 0.06f;
      ASSERT_LT(moved, limb ? 0.22f : 0.12f) << "shape " << i << " at " << t << " s";
    }
    before = now;
  }
}

std::vector<const char*> names() {
  std::vector<const char*> all;
  for (const Scene& scene : all_scenes()) all.push_back(scene.name);
  return all;
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene, testing::ValuesIn(names()),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST(Scenes, most_of_the_hall_is_out_of_range_but_some_is_not) {
  const Scene& scene = scene_named("hall");
  ThreadPool workers(1);
  Renderer renderer(kSceneCamera);
  IdealImages images;
  for (double t = 0; t < scene.default_seconds; t += 1.0) {
    renderer.render(world_at(scene, t, true), scene.camera(t), workers, images);
    const auto far = std::count_if(images.depth_m.begin(), images.depth_m.end(),
                                   [](float z_m) { return z_m > kDepthMaxM; });
    const double share = static_cast<double>(far) / static_cast<double>(images.depth_m.size());
    EXPECT_GT(share, 0.45) << t;
    EXPECT_LT(share, 0.75) << t;
  }
}

TEST(Scenes, the_hand_is_nearer_than_the_camera_sees_and_before_the_sonar) {
  const Scene& scene = scene_named("near");
  ThreadPool workers(1);
  Renderer renderer(kSceneCamera);
  IdealImages images;
  for (double t = 0; t < scene.default_seconds; t += 0.5) {
    renderer.render(world_at(scene, t, false), scene.camera(t), workers, images);
    size_t hand = 0, measurable = 0;
    for (size_t i = 0; i < images.mask.size(); ++i) {
      hand += images.mask[i] == kTrulyDynamic ? 1 : 0;
      measurable += images.mask[i] == kTrulyDynamic && images.depth_m[i] >= kDepthMinM ? 1 : 0;
    }
    const float heard_m = sonar_reading_m(images, kSceneCamera);
    if (t < 1.6) {
      EXPECT_EQ(hand, 0u) << t;
      EXPECT_GT(heard_m, 1.0f) << t;
    }
    if (t < 2.6) continue;  // on its way
    EXPECT_GT(static_cast<double>(hand) / static_cast<double>(images.mask.size()), 0.15) << t;
    EXPECT_EQ(measurable, 0u) << t;
    EXPECT_NEAR(heard_m, 0.18f, 0.02f) << t;
  }
}

TEST(Sonar, tells_the_nearest_in_its_cone) {
  IdealImages images;
  const Intrinsics k = kSceneCamera;
  images.depth_m.assign(static_cast<size_t>(k.width * k.height), 6.0f);
  EXPECT_EQ(sonar_reading_m(images, k), 0.0f) << "out of its range";
  images.depth_m.assign(images.depth_m.size(), 2.0f);
  EXPECT_NEAR(sonar_reading_m(images, k), 2.0f, 0.004f);
  images.depth_m[static_cast<size_t>(k.width / 2 + k.width * (k.height / 2))] = 0.3f;
  EXPECT_NEAR(sonar_reading_m(images, k), 0.303f, 0.004f) << "4 cm below its axis";
  images.depth_m.assign(images.depth_m.size(), 2.0f);
  images.depth_m[0] = 0.3f;
  EXPECT_NEAR(sonar_reading_m(images, k), 2.0f, 0.004f) << "beside its cone";
  images.depth_m.assign(images.depth_m.size(), 0.001f);
  EXPECT_EQ(sonar_reading_m(images, k), 0.0f);
}

TEST(Scenes, fast_turns_about_6_degrees_a_frame_at_times) {
  const Pace pace = pace_of(scene_named("fast"));
  EXPECT_GT(pace.most_deg_per_frame, 5.5);
  EXPECT_LT(pace.deg_per_s, 90.0);  // only at times
}

TEST(Scenes, loop_comes_back_to_its_start) {
  const Scene& scene = scene_named("loop");
  const Se3d start = scene.camera(0);
  double nearest = 1e9, seen_yaw = 0;
  for (double t = 15.0; t < scene.default_seconds; t += kFrame_s)
    nearest = std::min(nearest, norm(scene.camera(t).translation - start.translation) +
                                    degrees_between(start, scene.camera(t)) / 57.3);
  EXPECT_LT(nearest, 0.06);
  for (double t = 0; t < 19.0; t += kFrame_s)
    seen_yaw += degrees_between(scene.camera(t), scene.camera(t + kFrame_s));
  EXPECT_GT(seen_yaw, 330.0);
}

TEST(Scenes, long_loop_walks_40_metres_and_sees_its_start_again) {
  const Scene& scene = scene_named("long_loop");
  double path_m = 0, farthest_m = 0;
  for (double t = 0; t < scene.default_seconds; t += kFrame_s) {
    const Vec3d here = scene.camera(t).translation;
    path_m += norm(scene.camera(t + kFrame_s).translation - here);
    farthest_m = std::max(farthest_m, norm(here - scene.camera(0).translation));
  }
  EXPECT_GT(path_m, 40.0);
  EXPECT_LT(path_m, 1.0 * scene.default_seconds);  // a walk, not a run
  EXPECT_GT(farthest_m, 10.0);                     // the start is out of sight and out of range
  const Se3d start = scene.camera(0), end = scene.camera(scene.default_seconds);
  EXPECT_LT(norm(end.translation - start.translation), 0.03);
  EXPECT_LT(degrees_between(start, end), 3.0);
}

TEST(Scenes, corridor_is_walked_there_and_back_and_turned_in_slowly) {
  const Scene& scene = scene_named("corridor");
  const Pace pace = pace_of(scene);
  double path_m = 0, farthest_m = 0, fastest_turn_deg = 0;
  const Se3d start = scene.camera(0), end = scene.camera(scene.default_seconds);
  for (double t = 0; t < scene.default_seconds; t += kFrame_s) {
    const Se3d here = scene.camera(t), next = scene.camera(t + kFrame_s);
    path_m += norm(next.translation - here.translation);
    farthest_m = std::max(farthest_m, norm(here.translation - start.translation));
    fastest_turn_deg = std::max(fastest_turn_deg, degrees_between(here, next));
  }
  EXPECT_GT(farthest_m, 60.0);
  EXPECT_GT(path_m, 2 * farthest_m);
  EXPECT_LT(path_m, 130.0);
  EXPECT_GT(pace.m_per_s, 0.8);  // with the time for turning
  EXPECT_LT(fastest_turn_deg, 1.5);
  EXPECT_LT(norm(end.translation - start.translation), 0.03);
  EXPECT_LT(degrees_between(start, end), 3.0);
}

TEST(Scenes, corridor_is_60_m_long_and_its_lens_keeps_30_cm_clear) {
  const Scene& scene = scene_named("corridor");
  const World world = world_at(scene, 0, false);
  EXPECT_GE(world.shapes[0].half_m.x, 30.0f);
  for (double t = 0; t < scene.default_seconds; t += 0.1) {
    const Vec3 lens = cast<float>(scene.camera(t)).translation;
    for (const Shape& shape : world.shapes) ASSERT_GE(distance_m(shape, lens), 0.3f) << "at " << t << " s";
  }
}

/// What of a view can be measured, and what of that stops a camera from sliding along x.
struct Grip {
  double measured = 0;  ///< of the rays
  double across = 0;    ///< of the measured: 2 cm along x lead off that surface
};

Grip grip_of(const IdealImages& images, const World& world, const Se3d& T_world_cam) {
  constexpr int32_t kStep = 3;
  const Se3 T = cast<float>(T_world_cam);
  int rays = 0, measured = 0, across = 0;
  for (int32_t row = 0; row < kSceneCamera.height; row += kStep)
    for (int32_t col = 0; col < kSceneCamera.width; col += kStep) {
      ++rays;
      const auto i = static_cast<size_t>(row * kSceneCamera.width + col);
      const float depth_m = images.depth_m[i];
      if (depth_m < kDepthMinM || depth_m > kDepthMaxM || images.cos_incidence[i] < 0.2f) continue;
      ++measured;
      const Vec3 p = T * unproject(kSceneCamera, static_cast<float>(col), static_cast<float>(row), depth_m);
      float off_m = 1e9f;
      for (const Shape& shape : world.shapes)
        off_m = std::min(off_m, std::abs(distance_m(shape, p + Vec3{0.02f, 0, 0})));
      across += off_m > 0.01f ? 1 : 0;
    }
  return {static_cast<double>(measured) / rays, static_cast<double>(across) / std::max(measured, 1)};
}

TEST(Scenes, corridor_never_shows_bare_walls_only) {
  const Scene& scene = scene_named("corridor");
  const World world = world_at(scene, 0, false);
  ThreadPool workers(1);
  Renderer renderer(kSceneCamera);
  IdealImages images;
  for (double t = 0; t < scene.default_seconds; t += 1.0) {
    renderer.render(world, scene.camera(t), workers, images);
    const Grip grip = grip_of(images, world, scene.camera(t));
    EXPECT_GT(grip.measured, 0.65) << "at " << t << " s";
    EXPECT_GT(grip.across, 0.05) << "at " << t << " s";
  }
}

TEST(Scenes, obstructing_box_fills_80_percent_for_two_seconds) {
  double filled_s = 0, longest_s = 0;
  for (const Shares& s : shares_over(scene_named("obstructing_box"), 0.1)) {
    filled_s = s.moving >= 0.8 ? filled_s + 0.1 : 0.0;
    longest_s = std::max(longest_s, filled_s);
  }
  EXPECT_GE(longest_s, 2.0);
  EXPECT_LT(longest_s, 4.0);
}

TEST(Scenes, person_tracking_keeps_the_person_over_20_percent_of_the_view) {
  for (const Shares& s : shares_over(scene_named("person_tracking"), 0.2)) EXPECT_GT(s.moving, 0.2) << s.t_s;
}

TEST(Scenes, crowd_close_people_are_0_8_to_1_6_m_away) {
  const Scene& scene = scene_named("crowd_close");
  for (double t = 4.6; t < scene.default_seconds; t += 0.2) {
    const World world = world_at(scene, t, false);
    std::vector<Shape> movers;
    for (const Shape& shape : world.shapes)
      if (shape.moving) movers.push_back(shape);
    ASSERT_EQ(movers.size() % 3, 0u);
    const Vec3 lens = cast<float>(scene.camera(t)).translation;
    for (size_t who = 0; who < 3; ++who) {
      float nearest = 1e9f;
      for (size_t i = who * movers.size() / 3; i < (who + 1) * movers.size() / 3; ++i)
        nearest = std::min(nearest, distance_m(movers[i], lens));
      EXPECT_GT(nearest, 0.65f) << t;
      EXPECT_LT(nearest, 1.75f) << t;
    }
  }
}

TEST(Scenes, synchronous_people_stay_where_they_are_in_the_view) {
  const Scene& scene = scene_named("synchronous");
  for (double t = 3.0; t < 11.0; t += 0.1) {
    const World a = world_at(scene, t, false), b = world_at(scene, t + 0.5, false);
    const Se3 T_cam_world_a = cast<float>(inverse(scene.camera(t)));
    const Se3 T_cam_world_b = cast<float>(inverse(scene.camera(t + 0.5)));
    for (size_t i = 0; i < a.shapes.size(); ++i) {
      if (!a.shapes[i].moving || a.shapes[i].half_m.x < 0.12f) continue;  // the trunk, not the limbs
      const Vec3 moved_cam = T_cam_world_b * b.shapes[i].T_world_local.translation -
                             T_cam_world_a * a.shapes[i].T_world_local.translation;
      EXPECT_LT(norm(moved_cam), 0.09f) << t;  // the hand's unrest and the nodding of the camera remain
    }
  }
}

/// Smallest way (metres plus radians) from `place` to where the camera was before `until_s`.
double way_to_seen(const Scene& scene, const Se3d& place, double until_s) {
  double nearest = 1e9;
  for (double t = 0; t < until_s; t += kFrame_s)
    nearest = std::min(nearest, norm(scene.camera(t).translation - place.translation) +
                                    degrees_between(scene.camera(t), place) / 57.3);
  return nearest;
}

TEST(Scenes, a_covered_camera_comes_out_elsewhere_at_a_place_it_has_seen) {
  const struct {
    const char* name;
    double from_s, to_s, way;
  } covers[] = {{"covered", 9.0, 12.0, 0.5},
                {"camera_kidnapped", 6.0, 6.35, 0.5},
                {"camera_kidnapped", 10.0, 10.35, 0.5}};
  for (const auto& c : covers) {
    const Scene& scene = scene_named(c.name);
    ASSERT_NE(scene.covered, nullptr);
    EXPECT_FALSE(scene.covered(c.from_s - 0.01));
    EXPECT_TRUE(scene.covered(c.from_s + 0.01));
    EXPECT_TRUE(scene.covered(c.to_s - 0.01));
    EXPECT_FALSE(scene.covered(c.to_s + 0.01));
    const Se3d before = scene.camera(c.from_s), after = scene.camera(c.to_s);
    EXPECT_GT(norm(after.translation - before.translation) + degrees_between(before, after) / 57.3, c.way);
    EXPECT_LT(way_to_seen(scene, after, c.from_s), 0.3);
  }
  EXPECT_EQ(scene_named("static").covered, nullptr);
}

bool box_moves(const char* name, double t) {
  return world_at(scene_named(name), t, false).shapes.back().moving;
}

TEST(Scenes, a_box_is_dynamic_while_it_is_carried_and_static_while_it_rests) {
  for (const char* name : {"placing_box", "placing_obstructing_box"}) {
    EXPECT_TRUE(box_moves(name, 0.5)) << name;
    EXPECT_TRUE(box_moves(name, 4.0)) << name;
    EXPECT_FALSE(box_moves(name, 9.0)) << name;
  }
  for (const char* name : {"removing_box", "kidnapping_box"}) {
    EXPECT_FALSE(box_moves(name, 0.0)) << name;
    EXPECT_FALSE(box_moves(name, 3.0)) << name;
    EXPECT_TRUE(box_moves(name, 6.0)) << name;
    EXPECT_TRUE(box_moves(name, 12.0)) << name;
  }
}

TEST(Scenes, a_box_was_just_put_down_for_a_second) {
  const auto put_down = [](const char* name, double t) {
    return world_at(scene_named(name), t, false).shapes.back().put_down;
  };
  const struct {
    const char* name;
    double down_s;
  } cases[] = {{"placing_box", 6.0}, {"placing_obstructing_box", 7.6}};
  for (const auto& c : cases) {
    EXPECT_FALSE(put_down(c.name, c.down_s - 0.01)) << c.name;
    EXPECT_TRUE(put_down(c.name, c.down_s + 0.01)) << c.name;
    EXPECT_FALSE(box_moves(c.name, c.down_s + 0.01)) << c.name;
    EXPECT_TRUE(put_down(c.name, c.down_s + 0.99)) << c.name;
    EXPECT_FALSE(put_down(c.name, c.down_s + 1.01)) << c.name;
  }
  EXPECT_FALSE(put_down("removing_box", 0.0));  // has stood there all the time
}

TEST(Scenes, a_resting_box_does_not_move) {
  for (const char* name : {"placing_box", "placing_obstructing_box", "removing_box", "kidnapping_box"}) {
    const Scene& scene = scene_named(name);
    Shape before;
    bool rested = false;
    for (double t = 0; t < scene.default_seconds; t += kFrame_s) {
      const Shape box = world_at(scene, t, false).shapes.back();
      if (rested && !box.moving) {
        ASSERT_EQ(norm(box.T_world_local.translation - before.T_world_local.translation), 0.0f)
            << name << " " << t;
        for (int i = 0; i < 9; ++i)
          ASSERT_EQ(box.T_world_local.rotation.m[i], before.T_world_local.rotation.m[i]);
      }
      rested = !box.moving;
      before = box;
    }
  }
}

}  // namespace
}  // namespace stillmap::synthetic
