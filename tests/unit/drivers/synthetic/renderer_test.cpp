#include "drivers/synthetic/renderer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "drivers/synthetic/builders.hpp"

namespace stillmap::synthetic {
namespace {

constexpr Intrinsics kCamera = {131.25f, 131.25f, 79.5f, 59.5f, 160, 120};

World empty_room() {
  World world;
  world.shapes.push_back({Kind::room, false, {2.5f, 2.0f, 1.3f}, {Mat3{}, {0, 0, 1.3f}}, {}});
  return world;
}

IdealImages picture(const World& world, const Se3d& T_world_cam) {
  ThreadPool workers(1);
  Renderer renderer(kCamera);
  IdealImages images;
  renderer.render(world, T_world_cam, workers, images);
  return images;
}

/// Row 59, column 79: half a pixel from the axis.
float depth_on_axis(const IdealImages& images) {
  return images.depth_m[59 * 160 + 79];
}

TEST(Look, z_is_forward_y_down_x_right) {
  const Se3d level = look({1, 2, 3}, 0.0, 0.0, 0.0);
  EXPECT_NEAR((level * Vec3d{0, 0, 1}).x, 2.0, 1e-12);
  EXPECT_NEAR((level * Vec3d{0, 1, 0}).z, 2.0, 1e-12);
  EXPECT_NEAR((level * Vec3d{1, 0, 0}).y, 1.0, 1e-12);
}

TEST(Look, is_a_rotation_for_any_angles) {
  const Mat3T<double> r = look({0, 0, 0}, 2.7, -0.3, 0.2).rotation;
  const Mat3T<double> identity = transposed(r) * r;
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(identity.m[i], i % 4 == 0 ? 1.0 : 0.0, 1e-12);
  EXPECT_NEAR(dot(cross(Vec3d{r(0, 0), r(1, 0), r(2, 0)}, Vec3d{r(0, 1), r(1, 1), r(2, 1)}),
                  Vec3d{r(0, 2), r(1, 2), r(2, 2)}),
              1.0, 1e-12);
}

TEST(Renderer, wall_depth_is_the_distance_along_the_axis) {
  // Straight ahead every pixel that meets the wall has the depth of the wall.
  const IdealImages images = picture(empty_room(), look({-1.0, 0.2, 1.3}, 0, 0, 0));
  for (int row = 40; row < 80; ++row)
    for (int col = 40; col < 120; ++col)
      ASSERT_NEAR(images.depth_m[static_cast<size_t>(row * 160 + col)], 3.5f, 1e-5f);
}

TEST(Renderer, every_pixel_unprojects_onto_the_wall) {
  const World world = empty_room();
  const Se3d T_world_cam = look({-0.7, 0.4, 1.1}, 0.6, -0.3, 0.1);
  const IdealImages images = picture(world, T_world_cam);
  for (int row = 0; row < 120; ++row)
    for (int col = 0; col < 160; ++col) {
      const float z = images.depth_m[static_cast<size_t>(row * 160 + col)];
      const Vec3 p = unproject(kCamera, static_cast<float>(col), static_cast<float>(row), z);
      ASSERT_NEAR(distance_m(world.shapes[0], cast<float>(T_world_cam) * p), 0.0f, 1e-5f);
    }
}

TEST(Renderer, depth_of_each_solid_on_the_axis) {
  const Se3d T_world_cam = look({-1.5, 0, 1.3}, 0, 0, 0);
  const auto depth_of = [&](const Shape& shape) {
    World world = empty_room();
    world.shapes.push_back(shape);
    return depth_on_axis(picture(world, T_world_cam));
  };
  EXPECT_NEAR(depth_of(make_box({0.5f, 0, 1.3f}, {0.2f, 0.3f, 0.4f}, {})), 1.8f, 1e-4f);
  EXPECT_NEAR(depth_of(make_box({0.5f, 0, 1.3f}, {0.2f, 0.3f, 0.4f}, {}, 1.5707963f)), 1.7f, 1e-4f);
  EXPECT_NEAR(depth_of(make_ellipsoid({0.5f, 0, 1.3f}, {0.2f, 0.3f, 0.4f}, {})), 1.8f, 1e-3f);
  EXPECT_NEAR(depth_of(make_capsule({0.5f, 0, 1.0f}, {0.5f, 0, 1.6f}, 0.1f, {})), 1.9f, 1e-3f);
  EXPECT_NEAR(depth_of(make_capsule({0.5f, 0, 1.3f}, {0.9f, 0, 1.3f}, 0.1f, {})), 1.9f, 1e-3f);  // its cap
  EXPECT_NEAR(depth_of(make_box({-1.9f, 0, 1.3f}, {0.1f, 0.1f, 0.1f}, {})), 4.0f, 1e-4f);        // behind
}

TEST(Renderer, pixels_lie_on_what_is_there_and_nothing_is_nearer) {
  // Sphere tracing by the distance functions is an independent way to the same picture.
  World world;
  furnished_room(world);
  add_person(world, {{0.2f, 0.1f, 0}, 2.5f, 0.8f, 1.0f, 0.0f, {}, {}}, 1);
  const Se3d T_world_cam = look({-1.3, -0.2, 1.3}, 0.1, -0.1, 0.05);
  const IdealImages images = picture(world, T_world_cam);
  const Se3 T = cast<float>(T_world_cam);
  const auto distance_to_all = [&](Vec3 p) {
    float d = 1e9f;
    for (const Shape& shape : world.shapes) d = std::min(d, distance_m(shape, p));
    return d;
  };
  for (int row = 3; row < 120; row += 7)
    for (int col = 2; col < 160; col += 7) {
      const float z = images.depth_m[static_cast<size_t>(row * 160 + col)];
      const Vec3 ray = unproject(kCamera, static_cast<float>(col), static_cast<float>(row), 1.0f);
      ASSERT_NEAR(distance_to_all(T * (z * ray)), 0.0f, 2e-4f) << row << " " << col;
      for (float share = 0.05f; share < 0.99f; share += 0.02f)
        ASSERT_GT(distance_to_all(T * (share * z * ray)), -1e-4f) << row << " " << col << " at " << share;
    }
}

TEST(Renderer, mask_is_where_a_mover_is_seen) {
  World world = empty_room();
  Shape ball = make_ellipsoid({0.5f, 0, 1.3f}, {0.3f, 0.3f, 0.3f}, {});
  ball.moving = true;
  world.shapes.push_back(ball);
  const IdealImages images = picture(world, look({-1.5, 0, 1.3}, 0, 0, 0));
  size_t masked = 0;
  for (size_t i = 0; i < images.mask.size(); ++i) {
    ASSERT_EQ(images.mask[i] == 255, images.depth_m[i] < 2.1f);
    masked += images.mask[i] == 255 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(masked), 3.1416 * std::pow(131.25 * 0.3 / std::sqrt(4.0 - 0.09), 2), 40.0);
  world.shapes.back().moving = false;
  const IdealImages still = picture(world, look({-1.5, 0, 1.3}, 0, 0, 0));
  EXPECT_EQ(std::count(still.mask.begin(), still.mask.end(), 255), 0);
  EXPECT_EQ(still.depth_m, images.depth_m);
}

TEST(Renderer, incidence_is_one_head_on_and_small_at_the_rim) {
  World world = empty_room();
  const IdealImages images = picture(world, look({-1.5, 0, 1.3}, 0, 0, 0));
  EXPECT_NEAR(images.cos_incidence[59 * 160 + 79], 1.0f, 1e-3f);
  EXPECT_LT(images.cos_incidence[2 * 160 + 79], 0.8f);  // the ceiling
}

TEST(Renderer, textured_room_has_texture_and_bare_room_has_hardly_any) {
  const auto contrast = [](void (*room)(World&)) {
    World world;
    room(world);
    const IdealImages images = picture(world, look({-1.3, 0, 1.35}, 0, -0.05, 0));
    double sum = 0;
    int count = 0;
    for (size_t row = 0; row < 120; ++row)
      for (size_t col = 1; col < 160; ++col, ++count)
        sum += std::abs(static_cast<double>(images.colour[row * 160 + col].g) -
                        static_cast<double>(images.colour[row * 160 + col - 1].g));
    return sum / count;
  };
  EXPECT_GT(contrast(furnished_room), 5.0);
  EXPECT_LT(contrast(bare_room), 2.0);
}

TEST(Renderer, the_order_of_the_shapes_does_not_change_the_picture) {
  World world, reversed;
  furnished_room(world);
  reversed = world;
  std::reverse(reversed.shapes.begin() + 1, reversed.shapes.end());
  const Se3d T_world_cam = look({-1.2, 0.3, 1.3}, 0.3, -0.2, 0.05);
  EXPECT_EQ(picture(world, T_world_cam).depth_m, picture(reversed, T_world_cam).depth_m);
}

TEST(Renderer, of_two_surfaces_at_the_same_place_the_first_of_the_world_is_seen) {
  // Seen at an angle the wide block begins nearer than the small one, whose front is in the same plane.
  const Shape small = make_block({1.0f, -0.3f, 1.0f}, {1.5f, 0.3f, 1.6f}, {Pattern::plain, {200, 0, 0}});
  const Shape wide = make_block({1.0f, -0.9f, 0.8f}, {1.5f, 0.9f, 1.8f}, {Pattern::plain, {0, 200, 0}});
  for (const bool small_first : {true, false}) {
    World world = empty_room();
    world.shapes.push_back(small_first ? small : wide);
    world.shapes.push_back(small_first ? wide : small);
    const Rgb8 seen = picture(world, look({-1, 0, 1.3}, 0, 0, 0)).colour[59 * 160 + 79];
    EXPECT_EQ(seen.r > seen.g, small_first);
    const Rgb8 aside = picture(world, look({-0.6, 1.2, 1.3}, -0.6435, 0, 0)).colour[59 * 160 + 79];
    EXPECT_EQ(aside.r > aside.g, small_first);
  }
}

TEST(Renderer, a_row_of_lamps_lights_every_stretch_alike) {
  World world;
  world.shapes.push_back({Kind::room, false, {30.0f, 1.5f, 1.3f}, {Mat3{}, {0, 0, 1.3f}}, {}});
  const auto mean_red = [&](double x) {
    const IdealImages images = picture(world, look({x, 0, 1.3}, 1.5708, -0.4, 0));
    double sum = 0;
    for (const Rgb8 c : images.colour) sum += c.r;
    return sum / static_cast<double>(images.colour.size());
  };
  const double under_the_lamp = mean_red(0.2), far_from_it = mean_red(0.2 + 4 * 5.5);
  EXPECT_LT(far_from_it, 0.8 * under_the_lamp);
  world.lamp_spacing_m = 5.5f;
  EXPECT_GT(mean_red(0.2), under_the_lamp - 0.01);  // another one adds a little
  EXPECT_NEAR(mean_red(0.2 + 4 * 5.5), mean_red(0.2), 0.5);
  EXPECT_NEAR(mean_red(0.2 - 2 * 5.5), mean_red(0.2), 0.5);
}

}  // namespace
}  // namespace stillmap::synthetic
