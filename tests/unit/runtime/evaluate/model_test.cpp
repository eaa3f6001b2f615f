#include "runtime/evaluate/model.hpp"

#include <cmath>
#include <cstring>
#include <random>
#include <sstream>

#include <gtest/gtest.h>

#include "runtime/evaluate/ply_reader.hpp"
#include "runtime/evaluate/report.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

/// As the run writes mesh.ply.
std::string binary_mesh(const std::vector<Vec3>& vertices,
                        const std::vector<std::array<int32_t, 3>>& faces = {}) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment made by a test\nelement vertex " +
                      std::to_string(vertices.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                      "property uchar green\nproperty uchar blue\nelement face " +
                      std::to_string(faces.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vec3& p : vertices) {
    append(bytes, p.x);
    append(bytes, p.y);
    append(bytes, p.z);
    bytes += "\x01\x02\x03";
  }
  for (const auto& face : faces) {
    bytes += '\x03';
    for (const int32_t index : face) append(bytes, index);
  }
  return bytes;
}

std::string ascii_cloud(const std::vector<Vec3>& points, const char* type = "float") {
  std::ostringstream text;
  text << "ply\nformat ascii 1.0\nelement vertex " << points.size();
  for (const char* axis : {"x", "y", "z"}) text << "\nproperty " << type << " " << axis;
  text << "\nend_header\n";
  for (const Vec3& p : points) text << p.x << " " << p.y << " " << p.z << "\n";
  return text.str();
}

/// A plane of 1 x 1 m, tilted, sampled every centimetre.
Vec3 on_plane(float u, float v, float off_m = 0) {
  const Vec3 n = normalized(Vec3{0.3f, -0.5f, 0.8f}), a = normalized(cross(n, Vec3{0, 0, 1})),
             b = cross(n, a);
  return Vec3{2, 3, 1} + u * a + v * b + off_m * n;
}
std::vector<Vec3> plane_cloud() {
  std::vector<Vec3> points;
  for (int i = 0; i <= 100; ++i)
    for (int j = 0; j <= 100; ++j)
      points.push_back(on_plane(0.01f * static_cast<float>(i), 0.01f * static_cast<float>(j)));
  return points;
}
std::vector<Vec3> random_on_plane(int count, float off_m) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0.05f, 0.95f);
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) points.push_back(on_plane(unit(random), unit(random), off_m));
  return points;
}

class Model : public ::testing::Test {
 protected:
  Result<ModelResult> evaluate(const std::vector<Vec3>& truth, const std::vector<Vec3>& mesh,
                               ModelOptions options = {}) {
    return evaluate_model(dir_.write("truth.ply", ascii_cloud(truth)),
                          dir_.write("mesh.ply", binary_mesh(mesh)), options);
  }
  test::TempDir dir_;
};

TEST_F(Model, PlaneSampledEveryCentimetreIsMeasuredToUnderAMillimetre) {
  const auto result = evaluate(plane_cloud(), random_on_plane(3000, 0));
  ASSERT_TRUE(result) << result.error();
  EXPECT_LT(result->to_surface.distance_m.max, 1e-3);
  EXPECT_GT(result->to_point.distance_m.mean, 3e-3);  // what a sampled truth does to the plain distance
  EXPECT_GT(result->on_plane_share, 0.99);
  EXPECT_EQ(result->to_surface.within_1cm, 1);
  EXPECT_EQ(result->to_surface.ghosts, 0);
}

TEST_F(Model, KnowsTheDistanceToAPlane) {
  for (const float off_m : {0.004f, 0.015f, 0.024f}) {
    const auto result = evaluate(plane_cloud(), random_on_plane(500, off_m));
    ASSERT_TRUE(result);
    EXPECT_NEAR(result->to_surface.distance_m.mean, static_cast<double>(off_m), 1e-3);
    EXPECT_GE(result->to_point.distance_m.mean, result->to_surface.distance_m.mean);
  }
}

TEST_F(Model, ThereIsNoSurfaceBesideThePlane) {
  // 2 cm beside its edge, in its plane: the fitted plane runs on, the surface does not.
  const auto result = evaluate(plane_cloud(), {on_plane(0.5f, 1.02f)});
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->to_surface.distance_m.max, 0.02, 1e-3);
}

TEST_F(Model, ALineOfPointsSpansNoPlane) {
  std::vector<Vec3> line;
  for (int i = 0; i < 100; ++i) line.push_back({0.002f * static_cast<float>(i), 0, 0});
  const auto result = evaluate(line, {Vec3{0.1f, 0.01f, 0}, Vec3{0.1f, 0, 0.01f}});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->on_plane_share, 0);
  EXPECT_NEAR(result->to_surface.distance_m.min, 0.01, 1e-6);
}

TEST_F(Model, CurveSharesAndGhosts) {
  // One truth point; vertices at 0, 1.5, 4, 15 and 40 cm.
  const auto result = evaluate(
      {Vec3{}}, {Vec3{}, Vec3{0.015f, 0, 0}, Vec3{0, 0.04f, 0}, Vec3{0, 0, 0.15f}, Vec3{0.4f, 0, 0}});
  ASSERT_TRUE(result);
  const DistanceSummary& s = result->to_surface;
  EXPECT_DOUBLE_EQ(s.within_1cm, 0.2);
  EXPECT_DOUBLE_EQ(s.within_2cm, 0.4);
  EXPECT_DOUBLE_EQ(s.within_5cm, 0.6);
  EXPECT_NEAR(s.ghosts, 0.4, 1e-12);
  EXPECT_DOUBLE_EQ(s.curve[0], 0.2);
  EXPECT_DOUBLE_EQ(s.curve[7], 0.2);    // 14 mm
  EXPECT_DOUBLE_EQ(s.curve[8], 0.4);    // 16 mm
  EXPECT_DOUBLE_EQ(s.curve[100], 0.8);  // 20 cm
  std::istringstream csv(model_csv(*result));
  std::string line;
  int lines = 0;
  while (std::getline(csv, line)) ++lines;
  EXPECT_EQ(lines, 1 + kCurvePoints);
  EXPECT_NE(model_json(*result).find("\"ghosts\""), std::string::npos);
  EXPECT_NE(model_text(*result).find("ghosts"), std::string::npos);
}

TEST_F(Model, PoseMovesTheMesh) {
  const Se3d T = exp(Twistd{{1, 2, 3}, {0.2, -0.4, 0.9}});
  std::vector<Vec3> mesh = random_on_plane(300, 0);
  for (Vec3& p : mesh) p = inverse(cast<float>(T)) * p;
  ModelOptions options;
  options.T_truth_mesh = T;
  const auto result = evaluate(plane_cloud(), mesh, options);
  ASSERT_TRUE(result);
  EXPECT_LT(result->to_surface.distance_m.max, 1e-3);
  const auto unmoved = evaluate(plane_cloud(), mesh);
  EXPECT_TRUE(!unmoved || unmoved->to_surface.distance_m.mean > 0.1);
}

TEST_F(Model, ThinsWhatIsTooManyAndSaysSo) {
  ModelOptions options;
  options.max_truth_points = 1000;
  const auto result = evaluate(plane_cloud(), random_on_plane(300, 0), options);
  ASSERT_TRUE(result);
  EXPECT_LE(result->truth_points, 1000u);
  EXPECT_GT(result->truth_points, 499u);
  EXPECT_EQ(result->truth_points_file, 10201u);
  EXPECT_NE(result->warning.find("thinned"), std::string::npos);
}

TEST_F(Model, SameFiguresForAnyNumberOfThreads) {
  ModelOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const auto a = evaluate(plane_cloud(), random_on_plane(301, 0.01f), one);
  const auto b = evaluate(plane_cloud(), random_on_plane(301, 0.01f), three);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(model_json(*a), model_json(*b));
}

TEST_F(Model, TruthInAnotherPlaceIsAnError) {
  const auto result = evaluate({Vec3{100, 0, 0}}, {Vec3{}, Vec3{1, 0, 0}});
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().find("truth.ply"), std::string::npos);
  EXPECT_NE(result.error().find("frame"), std::string::npos);
}

TEST_F(Model, EmptyMeshAndMissingFilesAreErrors) {
  EXPECT_FALSE(evaluate({Vec3{}}, {}));
  const auto missing = evaluate_model(dir_.path("no.ply"), dir_.write("m.ply", binary_mesh({Vec3{}})));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().find("no.ply"), std::string::npos);
}

class Ply : public ::testing::Test {
 protected:
  void expect_error(const std::string& bytes, const std::string& part) {
    const auto result = read_ply_mesh(dir_.write("bad.ply", bytes));
    ASSERT_FALSE(result) << part;
    EXPECT_NE(result.error().find(part), std::string::npos) << result.error();
    EXPECT_NE(result.error().find("bad.ply"), std::string::npos);
  }
  test::TempDir dir_;
};

TEST_F(Ply, ReadsOurMesh) {
  const auto mesh = read_ply_mesh(dir_.write(
      "m.ply", binary_mesh({Vec3{1, 2, 3}, Vec3{4, 5, 6}, Vec3{7, 8, 9}}, {{0, 1, 2}, {2, 1, 0}})));
  ASSERT_TRUE(mesh) << mesh.error();
  ASSERT_EQ(mesh->vertices_m.size(), 3u);
  EXPECT_EQ(mesh->vertices_m[1].y, 5);
  ASSERT_EQ(mesh->colours.size(), 3u);
  EXPECT_EQ(mesh->colours[2].g, 2);
  ASSERT_EQ(mesh->triangles.size(), 2u);
  EXPECT_EQ(mesh->triangles[1][0], 2u);
}

TEST_F(Ply, ReadsAsciiDoublesOtherElementsAndPolygons) {
  const auto mesh = read_ply_mesh(
      dir_.write("m.ply",
                 "ply\r\nformat ascii 1.0\r\ncomment c\r\nelement camera 1\r\nproperty float f\r\n"
                 "element vertex 4\r\nproperty double x\r\nproperty double y\r\nproperty double z\r\n"
                 "property double quality\r\nelement face 1\r\nproperty list uchar uint vertex_index\r\n"
                 "end_header\r\n5.5\r\n0 0 0 9\r\n1 0 0 9\r\n1 1 0 9\r\n0 1e-1 0 9\r\n4 0 1 2 3\r\n"));
  ASSERT_TRUE(mesh) << mesh.error();
  ASSERT_EQ(mesh->vertices_m.size(), 4u);
  EXPECT_FLOAT_EQ(mesh->vertices_m[3].y, 0.1f);
  EXPECT_TRUE(mesh->colours.empty());
  EXPECT_EQ(mesh->triangles.size(), 2u);
}

TEST_F(Ply, ReadsDoublesAndLeavesOutWhatIsNotFinite) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double "
      "y\nproperty double z\n"
      "property short s\nend_header\n";
  for (const double x : {1.0, std::nan(""), 3.0}) {
    append(bytes, x);
    append(bytes, 0.5);
    append(bytes, -2.0);
    append(bytes, int16_t{7});
  }
  std::vector<Vec3> points;
  const auto left_out = read_ply_points(dir_.write("c.ply", bytes), [&](Vec3 p) { points.push_back(p); });
  ASSERT_TRUE(left_out) << left_out.error();
  EXPECT_EQ(*left_out, 1u);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].x, 3);
  EXPECT_EQ(points[1].z, -2);
  EXPECT_FALSE(read_ply_mesh(dir_.path("c.ply")));  // a mesh of ours never has such a vertex
}

TEST_F(Ply, SaysWhatIsWrong) {
  const std::string good = binary_mesh({Vec3{}, Vec3{}, Vec3{}}, {{0, 1, 2}});
  expect_error("", "begin with 'ply'");
  expect_error("solid stl", "begin with 'ply'");
  expect_error("ply\nformat ascii 1.0\n", "cut off");
  expect_error("ply\nformat binary_big_endian 1.0\nend_header\n", "binary_big_endian");
  expect_error("ply\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
               "no 'format'");
  expect_error("ply\nformat ascii 1.0\nend_header\n", "no element 'vertex'");
  expect_error("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "no x, y and z");
  expect_error("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "number of elements");
  expect_error("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "no property");
  expect_error("ply\nformat ascii 1.0\nelement vertex 1\nproperty vec3 x\nend_header\n", "no property");
  expect_error(good.substr(0, good.size() - 2), "cut off");
  expect_error(binary_mesh({Vec3{}}, {{0, 1, 0}}), "not there");
  expect_error(binary_mesh({Vec3{}}, {{0, -1, 0}}), "not there");
  expect_error(binary_mesh({Vec3{NAN, 0, 0}}), "not finite");
  expect_error(
      "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000000\nproperty float x\nproperty float "
      "y\n"
      "property float z\nend_header\n",
      "cut off");
  const std::string cloud = ascii_cloud({Vec3{}, Vec3{}});
  expect_error(cloud.substr(0, cloud.size() - 4), "cut off");
  expect_error(
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n1 a 2\n",
      "no number");
}

TEST_F(Ply, EveryCutOfAFileIsAnErrorAndNoCrash) {
  const std::string good = binary_mesh({Vec3{}, Vec3{}, Vec3{}}, {{0, 1, 2}});
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_FALSE(read_ply_mesh(dir_.write("cut.ply", good.substr(0, size)))) << size;
}

}  // namespace
}  // namespace stillmap
