#include "kernels/raycast/cast_ray.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "kernels/backend/cpu/raycast.hpp"
#include "tests/support/analytic_map.hpp"

namespace stillmap {
namespace {

const Rgb8 kRed = {200, 40, 40}, kBlue = {30, 60, 210};

struct Image {
  std::vector<float> depth_m;
  std::vector<Rgb8> colour;
  Intrinsics k;

  float depth(int32_t row, int32_t col) const { return depth_m[static_cast<size_t>(row * k.width + col)]; }
  Rgb8 rgb(int32_t row, int32_t col) const { return colour[static_cast<size_t>(row * k.width + col)]; }
};

const Intrinsics kSmall = {120, 120, 79.5f, 59.5f, 160, 120};

Image view_of(AnalyticMap& map, const Se3& T_map_cam, const Intrinsics& k = kSmall,
              bool through_backs = false) {
  Image image;
  const auto pixels = static_cast<size_t>(k.width * k.height);
  image.depth_m.assign(pixels, -1.0f);
  image.colour.assign(pixels, {1, 2, 3});
  image.k = k;
  RaycastPass pass{map.view(),
                   k,
                   T_map_cam,
                   {image.depth_m.data(), k.height, k.width, k.width},
                   {image.colour.data(), k.height, k.width, k.width}};
  pass.through_backs = through_backs;
  for (int32_t row = 0; row < k.height; row += 16) raycast_rows(pass, row, std::min(row + 16, k.height));
  return image;
}

RayHit cast(AnalyticMap& map, Vec3 origin, Vec3 direction, float near_m = 0.0f, float far_m = 5.0f,
            bool through_backs = false) {
  RayBlocks blocks;
  return cast_ray(map.view(), {origin, direction, near_m, far_m, through_backs}, blocks);
}

/// A wall at z = 0.6 m, in front of it free space from z = 0; `tau` of inside behind it.
AnalyticSample wall(Vec3d p) {
  AnalyticSample s;
  s.sdf_m = 0.6 - p.z;
  s.observed = s.sdf_m > -0.1;
  s.colour = p.x < 0 ? kRed : kBlue;
  return s;
}

TEST(CastRay, TiltedPlaneWithinAMillimetre) {
  AnalyticMap map(6000);
  const Vec3d normal = normalized(Vec3d{0.3, 0.2, -1.0}), point = {0, 0, 0.8};
  map.fill({-8, -8, 0}, {7, 7, 15}, [&](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = plane_sdf(p, point, normal);
    s.colour = p.x < 0 ? kRed : kBlue;
    return s;
  });
  const Image image = view_of(map, {{}, {0.01f, -0.02f, 0.05f}});
  int hits = 0;
  for (int32_t r = 0; r < image.k.height; ++r)
    for (int32_t c = 0; c < image.k.width; ++c) {
      const Vec3 ray = unproject(image.k, float(c), float(r), 1.0f);
      const Vec3d d = {double{ray.x}, double{ray.y}, 1.0}, o = {0.01, -0.02, 0.05};
      const double expected = dot(point - o, normal) / dot(d, normal);
      const Vec3d hit = o + expected * d;
      if (std::fabs(hit.x) > 0.6 || std::fabs(hit.y) > 0.6) continue;
      ASSERT_NEAR(double{image.depth(r, c)}, expected, 1e-3) << r << ' ' << c;
      if (std::fabs(hit.x) > 0.02) {
        ASSERT_NEAR(image.rgb(r, c).r, hit.x < 0 ? kRed.r : kBlue.r, 2);
        ASSERT_NEAR(image.rgb(r, c).b, hit.x < 0 ? kRed.b : kBlue.b, 2);
      }
      ++hits;
    }
  EXPECT_GT(hits, 15000);
}

TEST(CastRay, SphereFromAllSides) {
  AnalyticMap map(4200);
  const Vec3d centre = {0.03, -0.02, 0.05};
  const double radius = 0.25;
  map.fill({-8, -8, -8}, {7, 7, 7}, [&](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = sphere_sdf(p, centre, radius);
    s.colour = kBlue;
    return s;
  });
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  int hits = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3d from = centre + 0.55 * normalized(Vec3d{normal(random), normal(random), normal(random)});
    const Vec3d aim = centre + 0.1 * Vec3d{normal(random), normal(random), normal(random)};
    const Vec3d d = normalized(aim - from);
    const Vec3d m = from - centre;
    const double b = dot(m, d), disc = b * b - dot(m, m) + radius * radius;
    const Vec3 o32 = {float(from.x), float(from.y), float(from.z)},
               d32 = {float(d.x), float(d.y), float(d.z)};
    const RayHit hit = cast(map, o32, d32);
    if (disc < -0.003) {
      ASSERT_EQ(hit.depth_m, 0.0f);
    } else if (disc > 0.003) {  // not grazing
      ASSERT_NEAR(double{hit.depth_m}, -b - std::sqrt(disc), 1e-3);
      ASSERT_NEAR(hit.colour.b, kBlue.b, 2);
      ++hits;
    }
  }
  EXPECT_GT(hits, 2000);
}

TEST(CastRay, DepthIsAlongZNotAlongTheRay) {
  AnalyticMap map(2000);
  map.fill({-6, -6, 0}, {5, 5, 9}, wall);
  const Image image = view_of(map, {});
  EXPECT_NEAR(image.depth(10, 10), 0.6f, 1e-3f);
  EXPECT_NEAR(image.depth(60, 80), 0.6f, 1e-3f);
  EXPECT_NEAR(image.depth(110, 150), 0.6f, 1e-3f);
}

TEST(CastRay, ADirectionOfAnyLengthScalesTheDepth) {
  AnalyticMap map(2000);
  map.fill({-6, -6, 0}, {5, 5, 9}, wall);
  EXPECT_NEAR(cast(map, {}, {0, 0, 1}).depth_m, 0.6f, 1e-3f);
  EXPECT_NEAR(cast(map, {}, {0, 0, 2}).depth_m, 0.3f, 1e-3f);
  EXPECT_NEAR(cast(map, {}, {0, 0, 0.5f}).depth_m, 1.2f, 2e-3f);
}

TEST(CastRay, ThroughAbsentBlocksAndUnobservedVoxelsToAFrontFace) {
  AnalyticMap map(2000);
  map.fill({-6, -6, 5}, {5, 5, 9}, [](Vec3d p) {
    AnalyticSample s = wall(p);
    s.observed = s.observed && p.z > 0.47;  // within a block that is there
    return s;
  });
  EXPECT_NEAR(cast(map, {0, 0, -2}, {0, 0, 1}).depth_m, 2.6f, 1e-3f);
  EXPECT_NEAR(cast(map, {-0.3f, 0.2f, -3}, {0.1f, -0.05f, 1}).depth_m, 3.6f, 1e-3f);
  EXPECT_EQ(cast(map, {0, 0, -2}, {0, 0, 1}, 0.0f, 2.5f).depth_m, 0.0f) << "beyond far_m";
  EXPECT_EQ(cast(map, {0, 0, 0.5f}, {0, 0, -1}).depth_m, 0.0f) << "looking away";
}

TEST(CastRay, InsideEnteredOutOfTheUnseenIsNoSurface) {
  AnalyticMap map(2000);
  map.fill({-6, -6, 0}, {5, 5, 9}, [](Vec3d p) {
    AnalyticSample s = wall(p);
    s.observed = s.observed && std::fabs(s.sdf_m) > 0.03;
    return s;
  });
  EXPECT_EQ(cast(map, {}, {0, 0, 1}).depth_m, 0.0f);
}

TEST(CastRay, BacksEndTheRayUnlessTheyAreTransparent) {
  // A room seen from behind its near wall (inside below z = 0.2) with the far wall at z = 0.6.
  AnalyticMap map(2000);
  map.fill({-6, -6, 0}, {5, 5, 9}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = std::min(p.z - 0.2, 0.6 - p.z);
    s.observed = s.sdf_m > -0.1;
    s.colour = kRed;
    return s;
  });
  EXPECT_EQ(cast(map, {0, 0, -1}, {0, 0, 1}).depth_m, 0.0f) << "from behind";
  EXPECT_EQ(cast(map, {0, 0, 0.15f}, {0, 0, 1}).depth_m, 0.0f) << "camera inside";
  EXPECT_NEAR(cast(map, {0, 0, 0.4f}, {0, 0, 1}).depth_m, 0.2f, 1e-3f) << "within the room";
  EXPECT_NEAR(cast(map, {0, 0, -1}, {0, 0, 1}, 0, 5, true).depth_m, 1.6f, 1e-3f);
  EXPECT_NEAR(cast(map, {0, 0, 0.15f}, {0, 0, 1}, 0, 5, true).depth_m, 0.45f, 1e-3f);
}

TEST(CastRay, TheRimOfAnObjectIsNoSurface) {
  // The plate of NoWallsBetweenFreeSpaceAndTheUnseenInside, from its side: free space, then inside at once.
  AnalyticMap map(300);
  map.fill({-3, -3, 0}, {2, 2, 4}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = std::fabs(p.x) < 0.1 && std::fabs(p.y) < 0.1 ? 0.2 - p.z : 1.0;
    s.observed = s.sdf_m > -0.1;
    return s;
  });
  EXPECT_EQ(cast(map, {-0.2f, 0, 0.25f}, {1, 0, 0}).depth_m, 0.0f);
  EXPECT_NEAR(cast(map, {0, 0, 0}, {0, 0, 1}).depth_m, 0.2f, 1e-3f);
}

TEST(CastRay, UncolouredSurfaceIsGreyAndHalfColouredTakesWhatThereIs) {
  AnalyticMap map(2000);
  map.fill({-6, -6, 0}, {5, 5, 9}, [](Vec3d p) {
    AnalyticSample s = wall(p);
    s.colour = kRed;
    s.coloured = p.x > 0 && p.z < 0.605;  // the outer layer only
    return s;
  });
  const RayHit grey = cast(map, {-0.1f, 0, 0}, {0, 0, 1}), red = cast(map, {0.1f, 0, 0}, {0, 0, 1});
  EXPECT_EQ(grey.colour.r, kUncoloured.r);
  EXPECT_EQ(grey.colour.b, kUncoloured.b);
  EXPECT_NEAR(red.colour.r, kRed.r, 2);
  EXPECT_NEAR(red.colour.g, kRed.g, 2);
}

TEST(CastRay, NothingIsZeroDepthAndBlack) {
  AnalyticMap map(10);
  const Image image = view_of(map, {});
  for (const float d : image.depth_m) ASSERT_EQ(d, 0.0f);
  for (const Rgb8 c : image.colour) ASSERT_EQ(c.r + c.g + c.b, 0);
}

TEST(CastRay, EveryPoseAndEveryCameraEnds) {
  AnalyticMap map(40);
  std::mt19937 random(11);
  std::uniform_int_distribution<int> any(-32768, 32767);
  for (int i = 0; i < 27; ++i)
    for (VoxelSurface& v : map.block({i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1})->surface)
      v.sdf = static_cast<int16_t>(any(random));
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const float odd[] = {0.0f, -0.0f, 1e-30f, 0.03f, -0.11f, 1.0f, 1e4f, 1e6f, -1e12f, 1e38f, inf, nan};
  std::uniform_int_distribution<size_t> pick(0, std::size(odd) - 1);
  std::uniform_real_distribution<float> near(-0.3f, 0.3f), unit(-1.0f, 1.0f);
  const auto number = [&](auto& usual) { return random() % 4 == 0 ? odd[pick(random)] : usual(random); };
  int hits = 0;
  for (int i = 0; i < 3000; ++i) {
    RayBlocks blocks;
    const Ray ray = {{number(near), number(near), number(near)},
                     {number(unit), number(unit), number(unit)},
                     0.0f,
                     random() % 16 == 0 ? odd[pick(random)] : 3.0f,
                     random() % 2 == 0};
    const RayHit hit = cast_ray(map.view(), ray, blocks);
    ASSERT_TRUE(hit.depth_m == 0.0f || (hit.depth_m > 0.0f && hit.depth_m < ray.far_m));
    hits += hit.depth_m > 0.0f;
  }
  EXPECT_GT(hits, 20);
  for (const float f : odd) view_of(map, {{}, {0, 0, -1}}, {f, 100, 3.5f, 3.5f, 8, 8});
}

}  // namespace
}  // namespace stillmap
