#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <utility>

#include "kernels/backend/cpu/extract.hpp"
#include "kernels/extract/surface_rule.hpp"
#include "tests/support/analytic_map.hpp"
#include "tests/support/mesh_recorder.hpp"

namespace stillmap {
namespace {

constexpr double kVoxel = 0.01;
const Vec3d kCentre = {0.013, -0.027, 0.041};
constexpr double kRadius = 0.3;

Status extract(AnalyticMap& map, MeshRecorder& mesh, int32_t threads = 1) {
  const VolumeView view = map.view();
  std::vector<uint64_t> scratch(extract_scratch_bytes(view.block_keys.size) / 8 + 9);
  auto* memory = reinterpret_cast<uint8_t*>((reinterpret_cast<uintptr_t>(scratch.data()) + 63) / 64 * 64);
  ThreadPool pool(threads);
  return extract_mesh(view, mesh,
                      {memory, static_cast<uint32_t>(extract_scratch_bytes(view.block_keys.size))}, pool);
}

Vec3d position(const MeshRecorder& mesh, uint32_t i) {
  const Vec3 p = mesh.positions[i];
  return {double{p.x}, double{p.y}, double{p.z}};
}

AnalyticSample sphere(Vec3d p) {
  AnalyticSample s;
  s.sdf_m = sphere_sdf(p, kCentre, kRadius);
  s.colour = p.x < kCentre.x ? Rgb8{200, 40, 40} : Rgb8{30, 60, 210};
  return s;
}

/// Faces of each directed edge.
std::map<std::pair<uint32_t, uint32_t>, int> directed_edges(const MeshRecorder& mesh) {
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (size_t t = 0; t < mesh.indices.size(); t += 3)
    for (size_t i = 0; i < 3; ++i) ++edges[{mesh.indices[t + i], mesh.indices[t + (i + 1) % 3]}];
  return edges;
}

/// Edges without a second triangle. Fails when three or more meet, or two in the same direction.
std::vector<std::pair<uint32_t, uint32_t>> open_edges(const MeshRecorder& mesh) {
  const auto edges = directed_edges(mesh);
  std::vector<std::pair<uint32_t, uint32_t>> open;
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1) << "two triangles run along an edge in the same direction";
    if (!edges.count({edge.second, edge.first})) open.push_back(edge);
  }
  return open;
}

/// Counts match, indices are in range, every vertex is used, none is there twice.
void check_form(const MeshRecorder& mesh) {
  EXPECT_EQ(mesh.begins, 1);
  EXPECT_EQ(mesh.announced_vertices, mesh.positions.size());
  EXPECT_EQ(mesh.announced_vertices, mesh.colours.size());
  EXPECT_EQ(mesh.announced_triangles, mesh.triangle_count());
  EXPECT_FALSE(mesh.vertices_after_triangles);
  std::vector<bool> used(mesh.positions.size());
  for (const uint32_t i : mesh.indices) {
    ASSERT_LT(i, mesh.positions.size());
    used[i] = true;
  }
  for (const bool u : used) ASSERT_TRUE(u) << "a vertex without a triangle";
  std::set<std::array<float, 3>> places;
  for (const Vec3 p : mesh.positions) places.insert({p.x, p.y, p.z});
  EXPECT_EQ(places.size(), mesh.positions.size()) << "a vertex twice";
}

TEST(ExtractMesh, SphereAcrossManyBlocksIsClosedAndRight) {
  AnalyticMap map(1200);
  map.fill({-5, -5, -5}, {4, 4, 4}, sphere);
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh), Status::ok);
  check_form(mesh);
  ASSERT_GT(mesh.triangle_count(), 10000u);

  const auto edges = directed_edges(mesh);
  EXPECT_TRUE(open_edges(mesh).empty());
  const auto euler = static_cast<int64_t>(mesh.positions.size()) - static_cast<int64_t>(edges.size() / 2) +
                     static_cast<int64_t>(mesh.triangle_count());
  EXPECT_EQ(euler, 2);

  for (uint32_t i = 0; i < mesh.positions.size(); ++i)
    ASSERT_NEAR(norm(position(mesh, i) - kCentre), kRadius, 0.1 * kVoxel);
  double area = 0, volume = 0;
  for (size_t t = 0; t < mesh.indices.size(); t += 3) {
    const Vec3d a = position(mesh, mesh.indices[t]) - kCentre,
                b = position(mesh, mesh.indices[t + 1]) - kCentre,
                c = position(mesh, mesh.indices[t + 2]) - kCentre;
    const Vec3d normal = cross(b - a, c - a);
    area += 0.5 * norm(normal);
    volume += dot(a, cross(b, c)) / 6;
    // Slivers have no clear direction.
    if (norm(normal) < 1e-7) continue;
    ASSERT_GT(dot(normal, a), 0) << "triangle " << t / 3;
  }
  EXPECT_NEAR(area, 4 * M_PI * kRadius * kRadius, 0.01 * 4 * M_PI * kRadius * kRadius);
  EXPECT_NEAR(volume, 4.0 / 3 * M_PI * std::pow(kRadius, 3), 0.01 * 4.0 / 3 * M_PI * std::pow(kRadius, 3));
}

TEST(ExtractMesh, ColoursAreThoseOfTheVoxels) {
  AnalyticMap map(1200);
  map.fill({-5, -5, -5}, {4, 4, 4}, sphere);
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh), Status::ok);
  int left = 0, right = 0;
  for (uint32_t i = 0; i < mesh.positions.size(); ++i) {
    const double x = position(mesh, i).x - kCentre.x;
    if (std::fabs(x) < kVoxel) continue;
    const Rgb8 expected = x < 0 ? Rgb8{200, 40, 40} : Rgb8{30, 60, 210}, got = mesh.colours[i];
    ASSERT_NEAR(got.r, expected.r, 2);
    ASSERT_NEAR(got.g, expected.g, 2);
    ASSERT_NEAR(got.b, expected.b, 2);
    ++(x < 0 ? left : right);
  }
  EXPECT_GT(left, 1000);
  EXPECT_GT(right, 1000);
}

TEST(ExtractMesh, HalfObservedSphereIsOpenOnlyAtTheLimit) {
  AnalyticMap map(1200);
  const double limit = kCentre.z - 0.004;
  map.fill({-5, -5, -5}, {4, 4, 4}, [&](Vec3d p) {
    AnalyticSample s = sphere(p);
    s.observed = p.z < limit;
    return s;
  });
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh), Status::ok);
  check_form(mesh);
  ASSERT_GT(mesh.triangle_count(), 5000u);
  const auto open = open_edges(mesh);
  EXPECT_GT(open.size(), 50u);
  for (const auto& [a, b] : open) {
    ASSERT_GT(position(mesh, a).z, limit - 2.01 * kVoxel);
    ASSERT_GT(position(mesh, b).z, limit - 2.01 * kVoxel);
  }
}

TEST(ExtractMesh, BlockIdsOrderAndThreadsDoNotChangeABit) {
  const auto box = [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m =
        std::min(box_sdf(p, {0.03, 0.02, -0.05}, {0.21, 0.13, 0.3}), sphere_sdf(p, {0, 0.2, 0.1}, 0.17));
    s.colour = {static_cast<uint8_t>(std::lround(p.x * 300) & 0xff), 90, 120};
    return s;
  };
  MeshRecorder reference;
  for (const uint32_t seed : {0u, 1u, 2u}) {
    AnalyticMap map(1400 + seed * 1000);
    if (seed) map.shuffle_ids(seed);
    map.fill({-5, -5, -5}, {4, 5, 4}, box, seed);
    MeshRecorder mesh;
    ASSERT_EQ(extract(map, mesh, static_cast<int32_t>(1 + seed)), Status::ok);
    check_form(mesh);
    EXPECT_TRUE(open_edges(mesh).empty());
    if (seed == 0) {
      reference = mesh;
      continue;
    }
    ASSERT_EQ(mesh.positions.size(), reference.positions.size());
    EXPECT_EQ(
        std::memcmp(mesh.positions.data(), reference.positions.data(), mesh.positions.size() * sizeof(Vec3)),
        0);
    EXPECT_EQ(std::memcmp(mesh.colours.data(), reference.colours.data(), mesh.colours.size() * sizeof(Rgb8)),
              0);
    EXPECT_EQ(mesh.indices, reference.indices);
  }
}

TEST(ExtractMesh, RandomVoxelsStayManifold) {
  // All signs at random: every case of the table meets every other, ambiguous faces included.
  AnalyticMap map(27);
  std::mt19937 random(3);
  std::uniform_int_distribution<int> near(-kFarSdf + 1, kFarSdf - 1);
  for (int z = 0; z < 3; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 3; ++x)
        for (int i = 0; i < kBlockVoxels; ++i)
          map.observe({x - 1, y - 1, z - 1}, i, static_cast<int16_t>(near(random)));
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh), Status::ok);
  check_form(mesh);
  ASSERT_GT(mesh.triangle_count(), 20000u);
  const auto on_limit = [](Vec3d p) {
    const auto at = [](double c) { return c < -0.08 + 1e-6 || c > 0.15 - 1e-6; };
    return at(p.x) || at(p.y) || at(p.z);
  };
  for (const auto& [a, b] : open_edges(mesh))
    ASSERT_TRUE(on_limit(position(mesh, a)) && on_limit(position(mesh, b)));
}

TEST(ExtractMesh, EmptyMapAndFreeSpaceGiveNothing) {
  AnalyticMap empty(16);
  MeshRecorder mesh;
  EXPECT_EQ(extract(empty, mesh), Status::ok);
  EXPECT_EQ(mesh.begins, 1);
  EXPECT_EQ(mesh.announced_vertices + mesh.announced_triangles, 0u);
  EXPECT_EQ(mesh.calls, 1);

  AnalyticMap free(30);
  free.fill({0, 0, 0}, {2, 2, 2}, [](Vec3d p) {
    AnalyticSample s;
    s.observed = p.x + p.y < 0.3;
    s.sdf_m = 1;
    return s;
  });
  MeshRecorder nothing;
  EXPECT_EQ(extract(free, nothing), Status::ok);
  EXPECT_EQ(nothing.announced_vertices + nothing.announced_triangles, 0u);
}

TEST(ExtractMesh, NoWallsBetweenFreeSpaceAndTheUnseenInside) {
  // A camera on the z axis saw a plate at z = 0.2 m: in front of it free space, behind it tau of inside,
  // beside it free space all the way.
  AnalyticMap map(300);
  map.fill({-3, -3, 0}, {2, 2, 4}, [](Vec3d p) {
    AnalyticSample s;
    const bool before_plate = std::fabs(p.x) < 0.1 && std::fabs(p.y) < 0.1;
    s.sdf_m = before_plate ? 0.2 - p.z : 1.0;
    s.observed = s.sdf_m > -0.1;
    return s;
  });
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh), Status::ok);
  check_form(mesh);
  ASSERT_GT(mesh.triangle_count(), 500u);
  for (uint32_t i = 0; i < mesh.positions.size(); ++i) ASSERT_NEAR(position(mesh, i).z, 0.2, 0.1 * kVoxel);
}

TEST(ExtractMesh, ThinSheetsAndLonelyVoxelsAreClosed) {
  AnalyticMap map(60);
  map.fill({-1, -1, -1}, {1, 1, 1}, [](Vec3d p) {
    AnalyticSample s;  // one voxel thick, and single voxels above it
    const auto step = [](double c) { return static_cast<int>(std::lround(c / kVoxel)); };
    const bool sheet = step(p.z) == 0 && std::abs(step(p.x)) < 5 && std::abs(step(p.y)) < 5;
    const bool dot_above = step(p.z) == 4 && step(p.x) % 3 == 0 && step(p.y) % 3 == 0 &&
                           std::abs(step(p.x)) < 7 && std::abs(step(p.y)) < 7;
    s.sdf_m = sheet || dot_above ? -0.003 : 0.02;
    return s;
  });
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh), Status::ok);
  check_form(mesh);
  EXPECT_TRUE(open_edges(mesh).empty());
  EXPECT_GT(mesh.triangle_count(), 25u * 8u);
}

TEST(ExtractMesh, ASinkThatRefusesStopsIt) {
  AnalyticMap map(1200);
  map.fill({-5, -5, -5}, {4, 4, 4}, sphere);
  for (int call = 1; call <= 3; ++call) {
    MeshRecorder mesh;
    mesh.refuse_at_call = call;
    EXPECT_EQ(extract(map, mesh), Status::unavailable);
    EXPECT_EQ(mesh.calls, call);
  }
}

TEST(ExtractMesh, ScratchIsBoundedAndCheckedAndNotOverrun) {
  constexpr uint32_t kBlocks = 400000;
  EXPECT_LE(extract_scratch_bytes(kBlocks), 16ull * kBlocks + (3u << 20));

  AnalyticMap map(1200);
  map.fill({-5, -5, -5}, {4, 4, 4}, sphere);
  const auto bytes = static_cast<uint32_t>(extract_scratch_bytes(1200));
  std::vector<uint8_t> memory(bytes + 64 + 64, 0xa5);
  auto* aligned = reinterpret_cast<uint8_t*>((reinterpret_cast<uintptr_t>(memory.data()) + 63) / 64 * 64);
  ThreadPool pool(2);
  MeshRecorder mesh;
  EXPECT_EQ(extract_mesh(map.view(), mesh, {aligned, bytes - 1}, pool), Status::capacity_exhausted);
  EXPECT_EQ(extract_mesh(map.view(), mesh, {}, pool), Status::capacity_exhausted);
  EXPECT_EQ(mesh.calls, 0);
  EXPECT_EQ(extract_mesh(map.view(), mesh, {aligned, bytes}, pool), Status::ok);
  EXPECT_GT(mesh.triangle_count(), 0u);
  for (uint8_t* p = aligned + bytes; p < memory.data() + memory.size(); ++p) ASSERT_EQ(*p, 0xa5);
}

TEST(ExtractMesh, AMeshOfManyBatchesIsWhole) {
  // More vertices than one batch holds.
  AnalyticMap map(2800);
  map.fill({-10, -10, -3}, {9, 9, 3}, [](Vec3d p) {
    AnalyticSample s;
    s.sdf_m = 0.05 - std::fabs(std::remainder(p.z + 0.013, 0.2));  // sheets, 10 cm apart
    s.colour = {90, 90, 90};
    return s;
  });
  MeshRecorder mesh;
  ASSERT_EQ(extract(map, mesh, 2), Status::ok);
  ASSERT_GT(mesh.positions.size(), 100000u);
  check_form(mesh);
  for (uint32_t i = 0; i < mesh.positions.size(); ++i)
    ASSERT_NEAR(std::fabs(std::remainder(position(mesh, i).z + 0.013, 0.2)), 0.05, 1e-4);
  for (const auto& [a, b] : open_edges(mesh)) {
    const Vec3d p = position(mesh, a);
    ASSERT_TRUE(p.x < -0.79 || p.y < -0.79 || p.x > 0.78 || p.y > 0.78);
  }
}

}  // namespace
}  // namespace stillmap
