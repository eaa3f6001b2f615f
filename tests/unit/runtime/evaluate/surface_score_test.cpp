#include "runtime/evaluate/surface_score.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr Intrinsics kCamera = {100, 100, 49.5f, 39.5f, 100, 80};

/// One depth over the whole view.
struct View100 {
  std::vector<float> depth_m;
  std::vector<uint8_t> moving;

  explicit View100(float z_m) : depth_m(8000, z_m), moving(8000) {}
  void look(SeenSurface& surface, const Se3d& T_world_cam = {}) const {
    surface.look(T_world_cam, kCamera, {depth_m.data(), 80, 100, 100}, {moving.data(), 80, 100, 100});
  }
};

TEST(SeenSurface, APointIsSeenWhereDepthAgrees) {
  SeenSurface surface({{0, 0, 2}, {0, 0, 2.1f}, {0.5f, 0, 2.02f}, {3, 0, 2}, {0, 0, -2}});
  View100(2).look(surface);
  const std::vector<Vec3> seen = surface.seen(1);
  ASSERT_EQ(seen.size(), 2u);  // not what lies behind, outside of the view or behind the camera
  EXPECT_EQ(seen[0].x, 0);
  EXPECT_EQ(seen[1].x, 0.5f);
}

TEST(SeenSurface, MoversHideAndDepthHasToBeValid) {
  SeenSurface surface({{0, 0, 2}});
  View100 view(2);
  view.moving.assign(8000, 255);
  view.look(surface);
  View100(0).look(surface);
  EXPECT_TRUE(surface.seen(1).empty());
}

TEST(SeenSurface, TakesAsManyFramesAsAsked) {
  SeenSurface surface({{0, 0, 3}});
  const Se3d T_world_cam = {{}, {0, 0, 1}};  // two metres before the point
  for (int i = 0; i < 29; ++i) View100(2).look(surface, T_world_cam);
  EXPECT_TRUE(surface.seen().empty());
  View100(2).look(surface, T_world_cam);
  EXPECT_EQ(surface.seen().size(), 1u);
}

TEST(SeenSurface, PicksEvenlyFromALargeCloud) {
  std::vector<Vec3> cloud;
  for (int i = 0; i < 10000; ++i) cloud.push_back({0, 0, i < 5000 ? 2.0f : 4.0f});
  SeenSurface surface(cloud, 1000);
  View100(2).look(surface);
  EXPECT_NEAR(static_cast<double>(surface.seen(1).size()), 500, 5);
}

TEST(ShareWithin, CountsPointsWithANearVertex) {
  const std::vector<Vec3> vertices = {{0.019f, 0, 0}, {-1, -1, -1}};
  EXPECT_DOUBLE_EQ(share_within({{0, 0, 0}, {0.04f, 0, 0}, {-1, -1, -1.015f}, {5, 5, 5}}, vertices, 0.02f),
                   0.5);
  EXPECT_DOUBLE_EQ(share_within({{0, 0, 0}}, {}, 0.02f), 0);
  EXPECT_TRUE(std::isnan(share_within({}, vertices, 0.02f)));
}

}  // namespace
}  // namespace stillmap
