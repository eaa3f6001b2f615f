#include "runtime/evaluate/surface_score.hpp"

#include <cmath>
#include <limits>
#include <unordered_map>

#include "runtime/evaluate/mask_score.hpp"

namespace stillmap {
namespace {

constexpr float kAgree_m = 0.03f;
constexpr float kNoisePerSquareMetre = 0.004f;  ///< three sigma of a structured-light camera, 1/m

/// Picks `count` of all indices evenly, without the regular steps that would follow the rows of a cloud.
std::vector<Vec3> picked(const std::vector<Vec3>& cloud, size_t count) {
  if (cloud.size() <= count) return cloud;
  constexpr double kGoldenRatio = 0.6180339887498949;
  const double share = static_cast<double>(count) / static_cast<double>(cloud.size());
  std::vector<Vec3> points;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const double at = static_cast<double>(i) * kGoldenRatio;
    if (at - std::floor(at) < share && points.size() < count) points.push_back(cloud[i]);
  }
  return points;
}

/// Vertices by the cube of `edge_m` that they lie in.
class Cubes {
 public:
  Cubes(const std::vector<Vec3>& vertices, float edge_m) : vertices_(vertices), edge_m_(edge_m) {
    cubes_.reserve(vertices.size() / 4);
    for (size_t i = 0; i < vertices.size(); ++i) {
      const Cell c = cell(vertices[i]);
      cubes_[key(c.x, c.y, c.z)].push_back(static_cast<uint32_t>(i));
    }
  }

  bool any_within_edge(Vec3 p) const {
    const Cell c = cell(p);
    for (int64_t x = c.x - 1; x <= c.x + 1; ++x)
      for (int64_t y = c.y - 1; y <= c.y + 1; ++y)
        for (int64_t z = c.z - 1; z <= c.z + 1; ++z)
          if (any_within_edge(p, key(x, y, z))) return true;
    return false;
  }

 private:
  struct Cell {
    int64_t x, y, z;
  };
  Cell cell(Vec3 p) const {
    return {static_cast<int64_t>(std::floor(p.x / edge_m_)), static_cast<int64_t>(std::floor(p.y / edge_m_)),
            static_cast<int64_t>(std::floor(p.z / edge_m_))};
  }
  static uint64_t key(int64_t x, int64_t y, int64_t z) {
    constexpr int64_t kHalf = int64_t{1} << 20;  // 21 bits a coordinate
    return static_cast<uint64_t>(((x + kHalf) << 42) | ((y + kHalf) << 21) | (z + kHalf));
  }
  bool any_within_edge(Vec3 p, uint64_t cube) const {
    const auto at = cubes_.find(cube);
    if (at == cubes_.end()) return false;
    for (const uint32_t i : at->second) {
      const Vec3 d = vertices_[i] - p;
      if (dot(d, d) <= edge_m_ * edge_m_) return true;
    }
    return false;
  }

  const std::vector<Vec3>& vertices_;
  float edge_m_;
  std::unordered_map<uint64_t, std::vector<uint32_t>> cubes_;
};

}  // namespace

SeenSurface::SeenSurface(const std::vector<Vec3>& cloud_world, size_t max_points)
    : points_world_(picked(cloud_world, max_points)), frames_(points_world_.size()) {}

void SeenSurface::look(const Se3d& T_world_cam, const Intrinsics& k, ImageView<const float> depth_m,
                       ImageView<const uint8_t> truth_mask) {
  const Se3 T_cam_world = cast<float>(inverse(T_world_cam));
  for (size_t i = 0; i < points_world_.size(); ++i) {
    const Vec3 p = T_cam_world * points_world_[i];
    if (p.z < kValidDepthMin_m || p.z > kValidDepthMax_m) continue;
    const Pixel at = project(k, p);
    const int32_t row = static_cast<int32_t>(std::lround(at.v)),
                  col = static_cast<int32_t>(std::lround(at.u));
    if (!depth_m.contains(row, col)) continue;
    const float z_m = depth_m.at(row, col);
    if (!(z_m > 0) || std::abs(z_m - p.z) > kAgree_m + kNoisePerSquareMetre * p.z * p.z) continue;
    if (truth_mask.data != nullptr && truth_mask.at(row, col) == kTrulyDynamic) continue;
    ++frames_[i];
  }
}

std::vector<Vec3> SeenSurface::seen(uint32_t frames) const {
  std::vector<Vec3> points;
  for (size_t i = 0; i < points_world_.size(); ++i)
    if (frames_[i] >= frames) points.push_back(points_world_[i]);
  return points;
}

double share_within(const std::vector<Vec3>& points, const std::vector<Vec3>& vertices, float limit_m) {
  if (points.empty()) return std::numeric_limits<double>::quiet_NaN();
  const Cubes cubes(vertices, limit_m);
  size_t near = 0;
  for (const Vec3& p : points) near += cubes.any_within_edge(p);
  return static_cast<double>(near) / static_cast<double>(points.size());
}

}  // namespace stillmap
