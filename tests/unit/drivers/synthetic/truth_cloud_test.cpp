#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "drivers/synthetic/renderer.hpp"
#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/synthetic_source.hpp"

namespace stillmap {
namespace {

std::vector<Vec3> cloud_of(const std::string& spec) {
  auto source = open_synthetic(spec + ",size=64x48", 1);
  EXPECT_TRUE(source);
  return (*source)->truth_cloud();
}

int points_in(const std::vector<Vec3>& cloud, Vec3 low, Vec3 high) {
  return static_cast<int>(std::count_if(cloud.begin(), cloud.end(), [&](Vec3 p) {
    return p.x > low.x && p.x < high.x && p.y > low.y && p.y < high.y && p.z > low.z && p.z < high.z;
  }));
}

/// Where the carton rests on its stand.
int points_on_the_carton(const std::string& spec) {
  return points_in(cloud_of(spec), {0.2f, -0.15f, 0.95f}, {0.75f, 0.35f, 1.30f});
}

/// Where the box stands that is kidnapped.
int points_on_the_kidnapped_box(const std::string& spec) {
  return points_in(cloud_of(spec), {-0.6f, -0.4f, 0.90f}, {-0.1f, 0.4f, 1.55f});
}

TEST(TruthCloud, every_point_is_on_a_surface_and_can_be_seen) {
  const synthetic::Scene* scene = synthetic::find_scene("static");
  const synthetic::World world = synthetic::world_at(*scene, 0.0, false);
  const std::vector<Vec3> cloud = cloud_of("static");
  EXPECT_GT(cloud.size(), 500000u);
  EXPECT_LT(cloud.size(), 3000000u);
  for (size_t i = 0; i < cloud.size(); i += 37) {
    float nearest = 1e9f;
    for (const synthetic::Shape& shape : world.shapes)
      nearest = std::min(nearest, synthetic::distance_m(shape, cloud[i]));
    ASSERT_NEAR(nearest, 0.0f, 1e-4f) << cloud[i].x << " " << cloud[i].y << " " << cloud[i].z;
    ASSERT_LE(std::abs(cloud[i].x), 2.5001f);
    ASSERT_LE(std::abs(cloud[i].y), 2.0001f);
    ASSERT_TRUE(cloud[i].z > -1e-4f && cloud[i].z < 2.6001f);
  }
}

TEST(TruthCloud, wherever_the_camera_looks_a_point_is_within_a_centimetre) {
  const Intrinsics k = {65.6f, 65.6f, 39.5f, 29.5f, 80, 60};
  const std::vector<Vec3> cloud = cloud_of("loop-static");
  const auto key = [](int x, int y, int z) { return (x + 1024) | (y + 1024) << 11 | (z + 64) << 22; };
  const auto cell = [](float v) { return static_cast<int>(std::floor(v / 0.012f)); };
  std::unordered_set<int> cells;
  for (const Vec3& p : cloud) cells.insert(key(cell(p.x), cell(p.y), cell(p.z)));
  const synthetic::Scene* scene = synthetic::find_scene("loop");
  const synthetic::World world = synthetic::world_at(*scene, 0.0, true);
  ThreadPool workers(1);
  synthetic::Renderer renderer(k);
  synthetic::IdealImages images;
  int lonely = 0, seen = 0;
  for (double t = 0.5; t < 20; t += 2.0) {
    const Se3d T_world_cam = scene->camera(t);
    renderer.render(world, T_world_cam, workers, images);
    for (int row = 0; row < 60; ++row)
      for (int col = 0; col < 80; ++col, ++seen) {
        const float z = images.depth_m[static_cast<size_t>(row * 80 + col)];
        const Vec3 p =
            cast<float>(T_world_cam) * unproject(k, static_cast<float>(col), static_cast<float>(row), z);
        bool near = false;
        for (int d = 0; d < 27 && !near; ++d)
          near =
              cells.count(key(cell(p.x) + d % 3 - 1, cell(p.y) + d / 3 % 3 - 1, cell(p.z) + d / 9 - 1)) != 0;
        lonely += near ? 0 : 1;
      }
  }
  EXPECT_LT(lonely, seen / 1000);
}

TEST(TruthCloud, is_the_state_at_the_end) {
  EXPECT_GT(points_on_the_carton("placing_box"), 3000);
  EXPECT_EQ(points_on_the_carton("placing_box,seconds=3"), 0);  // still carried
  EXPECT_EQ(points_on_the_carton("removing_box"), 0);
  EXPECT_GT(points_on_the_carton("removing_box,seconds=2"), 3000);  // not yet taken
  EXPECT_EQ(points_on_the_kidnapped_box("kidnapping_box"), 0);
  EXPECT_GT(points_on_the_kidnapped_box("kidnapping_box,seconds=4"), 5000);
}

TEST(TruthCloud, people_are_not_in_it) {
  const auto points = [](const char* scene, bool without_movers) {
    return synthetic::sample_still_surface(
               synthetic::world_at(*synthetic::find_scene(scene), 6.0, without_movers), 0.04f)
        .size();
  };
  EXPECT_EQ(points("crowd", false), points("crowd", true));
  EXPECT_EQ(points("crowd", false), points("static", false));
}

}  // namespace
}  // namespace stillmap
