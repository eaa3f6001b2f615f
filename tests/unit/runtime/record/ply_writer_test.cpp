#include "runtime/record/ply_writer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "tests/support/temp_dir.hpp"
#include "tests/unit/runtime/record/file_size_limit.hpp"

namespace stillmap {
namespace {

using test::exists;
using test::FileSizeLimit;
using test::read_text;
using test::TempDir;

const std::vector<Vec3> kPositions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1.5f}};
const std::vector<Rgb8> kColours = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {255, 0, 128}};
const std::vector<uint32_t> kIndices = {0, 1, 2, 0, 2, 3};

template <class T>
View<const T> part(const std::vector<T>& all, uint32_t from, uint32_t count) {
  return {all.data() + from, count};
}

void give_mesh(PlyWriter& writer) {
  ASSERT_TRUE(writer.begin(4, 2));
  ASSERT_TRUE(writer.vertices(part(kPositions, 0, 3), part(kColours, 0, 3)));
  ASSERT_TRUE(writer.vertices(part(kPositions, 3, 1), part(kColours, 3, 1)));
  ASSERT_TRUE(writer.triangles(part(kIndices, 0, 3)));
  ASSERT_TRUE(writer.triangles(part(kIndices, 3, 3)));
}

TEST(PlyWriter, WritesTheContractsForm) {
  TempDir dir;
  PlyWriter writer(dir.path("mesh.ply"));
  give_mesh(writer);
  ASSERT_TRUE(writer.close()) << writer.error();
  const std::string text = read_text(dir.path("mesh.ply"));
  const std::string end = "end_header\n";
  const size_t body = text.find(end) + end.size();
  EXPECT_EQ(text.rfind("ply\nformat binary_little_endian 1.0\n", 0), 0u);
  EXPECT_NE(
      text.find("element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                "property uchar green\nproperty uchar blue\nelement face 2\n"
                "property list uchar int vertex_indices\n"),
      std::string::npos);
  ASSERT_EQ(text.size() - body, 4u * 15 + 2 * 13);
  float z = 0;
  std::memcpy(&z, &text[body + 3 * 15 + 8], 4);
  EXPECT_EQ(z, 1.5f);
  EXPECT_EQ(static_cast<uint8_t>(text[body + 3 * 15 + 14]), 128);
  EXPECT_EQ(text[body + 60], 3);
  std::array<int32_t, 3> triangle{};
  std::memcpy(triangle.data(), &text[body + 60 + 13 + 1], 12);
  EXPECT_EQ(triangle, (std::array<int32_t, 3>{0, 2, 3}));
}

TEST(PlyWriter, EmptyMeshIsAValidFile) {
  TempDir dir;
  PlyWriter writer(dir.path("mesh.ply"));
  ASSERT_TRUE(writer.begin(0, 0));
  ASSERT_TRUE(writer.close());
  EXPECT_NE(read_text(dir.path("mesh.ply")).find("element face 0\n"), std::string::npos);
}

TEST(PlyWriter, MissingPartsLeaveNoFile) {
  TempDir dir;
  PlyWriter writer(dir.path("mesh.ply"));
  ASSERT_TRUE(writer.begin(4, 2));
  ASSERT_TRUE(writer.vertices(part(kPositions, 0, 3), part(kColours, 0, 3)));
  EXPECT_FALSE(writer.close());
  EXPECT_NE(writer.error().find("3 of 4 vertices and 0 of 2 triangles"), std::string::npos) << writer.error();
  EXPECT_FALSE(exists(dir.path("mesh.ply")));
  EXPECT_FALSE(exists(dir.path("mesh.ply.part")));
}

TEST(PlyWriter, RefusesMoreThanAnnounced) {
  TempDir dir;
  PlyWriter vertices(dir.path("a.ply"));
  ASSERT_TRUE(vertices.begin(3, 1));
  EXPECT_FALSE(vertices.vertices(part(kPositions, 0, 4), part(kColours, 0, 4)));
  PlyWriter triangles(dir.path("b.ply"));
  ASSERT_TRUE(triangles.begin(4, 1));
  ASSERT_TRUE(triangles.vertices(part(kPositions, 0, 4), part(kColours, 0, 4)));
  EXPECT_FALSE(triangles.triangles(part(kIndices, 0, 6)));
  EXPECT_FALSE(triangles.close());
}

TEST(PlyWriter, RefusesWhatNoViewerReads) {
  TempDir dir;
  PlyWriter index(dir.path("a.ply"));
  ASSERT_TRUE(index.begin(3, 1));
  ASSERT_TRUE(index.vertices(part(kPositions, 0, 3), part(kColours, 0, 3)));
  const std::vector<uint32_t> beyond = {0, 1, 3};
  EXPECT_FALSE(index.triangles(part(beyond, 0, 3)));
  PlyWriter nan(dir.path("b.ply"));
  ASSERT_TRUE(nan.begin(1, 0));
  const std::vector<Vec3> bad = {{0, std::numeric_limits<float>::quiet_NaN(), 0}};
  EXPECT_FALSE(nan.vertices(part(bad, 0, 1), part(kColours, 0, 1)));
  PlyWriter many(dir.path("c.ply"));
  EXPECT_FALSE(many.begin(3'000'000'000, 1));
  EXPECT_TRUE(std::filesystem::is_empty(dir.path()));
}

TEST(PlyWriter, FullDiskKeepsTheMeshOfBefore) {
  TempDir dir;
  PlyWriter first(dir.path("mesh.ply"));
  give_mesh(first);
  ASSERT_TRUE(first.close());
  const std::string before = read_text(dir.path("mesh.ply"));
  FileSizeLimit full(100);
  PlyWriter second(dir.path("mesh.ply"));
  ASSERT_TRUE(second.begin(4, 2));
  second.vertices(part(kPositions, 0, 4), part(kColours, 0, 4));
  second.triangles(part(kIndices, 0, 6));
  EXPECT_FALSE(second.close());
  EXPECT_NE(second.error().find("File too large"), std::string::npos) << second.error();
  EXPECT_EQ(read_text(dir.path("mesh.ply")), before);
}

TEST(PointCloud, IsAPlyOfPoints) {
  TempDir dir;
  ASSERT_EQ(write_point_cloud(dir.path("cloud.ply"), kPositions), "");
  const std::string text = read_text(dir.path("cloud.ply"));
  EXPECT_NE(text.find("element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n"),
            std::string::npos);
  EXPECT_EQ(text.size() - (text.find("end_header\n") + 11), 4u * 12);
  ASSERT_EQ(write_point_cloud(dir.path("none.ply"), {}), "");
  EXPECT_NE(write_point_cloud("/nonexistent-folder/c.ply", kPositions), "");
}

}  // namespace
}  // namespace stillmap
