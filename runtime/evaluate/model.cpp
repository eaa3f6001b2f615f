#include "runtime/evaluate/model.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <nanoflann.hpp>

#include "runtime/evaluate/ply_reader.hpp"

namespace stillmap {
namespace {

constexpr std::size_t kNeighbours = 8;
constexpr double kNeighbourhood_m = 0.03;
constexpr double kGhost_m = 0.10;
constexpr float kMargin_m = 0.5f;
constexpr double kMaxThicknessRatio = 0.2;  ///< of a plane patch: standard deviation across over along it
constexpr double kMinWidthRatio = 0.2;      ///< of a patch: below it the points are a line and span no plane

struct Box {
  Vec3 low = {1e30f, 1e30f, 1e30f}, high = {-1e30f, -1e30f, -1e30f};

  void add(Vec3 p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  bool near(Vec3 p, float margin) const {
    return p.x >= low.x - margin && p.y >= low.y - margin && p.z >= low.z - margin &&
           p.x <= high.x + margin && p.y <= high.y + margin && p.z <= high.z + margin;
  }
};

/// Keeps every n-th point, n doubling whenever the limit is reached.
class ThinnedCloud {
 public:
  explicit ThinnedCloud(uint64_t limit) : limit_(std::max<uint64_t>(limit, 2)) {}

  void add(Vec3 p) {
    if (seen_++ % stride_ != 0) return;
    if (points_.size() == limit_) halve();
    points_.push_back(p);
  }
  std::vector<Vec3>& points() { return points_; }
  uint64_t stride() const { return stride_; }

 private:
  void halve() {
    for (std::size_t i = 0; 2 * i < points_.size(); ++i) points_[i] = points_[2 * i];
    points_.resize((points_.size() + 1) / 2);
    stride_ *= 2;
  }

  std::vector<Vec3> points_;
  uint64_t limit_, seen_ = 0, stride_ = 1;
};

/// What nanoflann asks of a set of points.
struct PointSet {
  const std::vector<Vec3>& points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t index, std::size_t dim) const {
    const Vec3& p = points[index];
    return dim == 0 ? p.x : dim == 1 ? p.y : p.z;
  }
  template <class BoundingBox>
  bool kdtree_get_bbox(BoundingBox&) const {
    return false;
  }
};

using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointSet>, PointSet, 3, uint32_t>;

struct Distances {
  float to_point_m = 0, to_surface_m = 0;
  bool on_plane = false;
};

Eigen::Vector3d vector(Vec3 p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
}

/// Distance to the plane through the neighbours, negative where they form none or `p` lies beside them.
double plane_distance(Vec3 p, const std::vector<Vec3>& points, const uint32_t (&indices)[kNeighbours]) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const uint32_t i : indices) mean += vector(points[i]) / static_cast<double>(kNeighbours);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double radius2 = 0;
  for (const uint32_t i : indices) {
    const Eigen::Vector3d d = vector(points[i]) - mean;
    covariance += d * d.transpose();
    radius2 = std::max(radius2, d.squaredNorm());
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector3d spread = solver.eigenvalues().cwiseMax(0).cwiseSqrt();  // smallest first
  if (spread[0] > kMaxThicknessRatio * spread[1] || spread[1] < kMinWidthRatio * spread[2]) return -1;
  const Eigen::Vector3d offset = vector(p) - mean;
  const double across = std::abs(solver.eigenvectors().col(0).dot(offset));
  const double along2 = offset.squaredNorm() - across * across;
  return along2 > radius2 ? -1 : across;
}

Distances distances_of(Vec3 p, const Tree& tree, const std::vector<Vec3>& points) {
  uint32_t indices[kNeighbours];
  float squares[kNeighbours];
  const float query[3] = {p.x, p.y, p.z};
  const std::size_t found = tree.knnSearch(query, kNeighbours, indices, squares);
  Distances d;
  d.to_point_m = d.to_surface_m = std::sqrt(squares[0]);
  if (found < kNeighbours ||
      static_cast<double>(squares[kNeighbours - 1]) > kNeighbourhood_m * kNeighbourhood_m)
    return d;
  const double plane_m = plane_distance(p, points, indices);
  if (plane_m < 0) return d;
  d.on_plane = true;
  d.to_surface_m = std::min(d.to_point_m, static_cast<float>(plane_m));
  return d;
}

std::vector<Distances> all_distances(const std::vector<Vec3>& vertices, const Tree& tree,
                                     const std::vector<Vec3>& points, int32_t threads) {
  std::vector<Distances> distances(vertices.size());
  const std::size_t workers = threads > 0 ? static_cast<std::size_t>(threads)
                                          : std::clamp(std::thread::hardware_concurrency(), 1u, 64u);
  const auto work = [&](std::size_t worker) {
    const std::size_t begin = vertices.size() * worker / workers,
                      end = vertices.size() * (worker + 1) / workers;
    for (std::size_t i = begin; i < end; ++i) distances[i] = distances_of(vertices[i], tree, points);
  };
  std::vector<std::jthread> pool;
  for (std::size_t worker = 1; worker < workers; ++worker) pool.emplace_back(work, worker);
  work(0);
  pool.clear();  // joins
  return distances;
}

DistanceSummary summarise(const std::vector<Distances>& distances, float Distances::*member) {
  std::vector<double> values;
  values.reserve(distances.size());
  for (const Distances& d : distances) values.push_back(static_cast<double>(d.*member));
  std::sort(values.begin(), values.end());
  const double n = static_cast<double>(values.size());
  const auto share_within = [&](double limit_m) {
    return static_cast<double>(std::upper_bound(values.begin(), values.end(), limit_m) - values.begin()) / n;
  };
  DistanceSummary summary;
  for (int i = 0; i < kCurvePoints; ++i)
    summary.curve[static_cast<std::size_t>(i)] = share_within(i * kCurveStep_m);
  summary.within_1cm = share_within(0.01);
  summary.within_2cm = share_within(0.02);
  summary.within_5cm = share_within(0.05);
  summary.ghosts = 1 - share_within(kGhost_m);
  summary.distance_m = statistics_of(std::move(values));
  return summary;
}

void thin(std::vector<Vec3>& vertices, uint64_t limit) {
  if (vertices.size() <= limit || limit == 0) return;
  const std::size_t stride = (vertices.size() + limit - 1) / limit;
  for (std::size_t i = 0; i * stride < vertices.size(); ++i) vertices[i] = vertices[i * stride];
  vertices.resize((vertices.size() + stride - 1) / stride);
}

Result<ModelResult> evaluate_loaded(const std::string& truth_ply, PlyMesh mesh, const ModelOptions& options) {
  Box box;
  for (Vec3& p : mesh.vertices_m) {
    const Vec3d moved = options.T_truth_mesh * Vec3d{p.x, p.y, p.z};
    p = {static_cast<float>(moved.x), static_cast<float>(moved.y), static_cast<float>(moved.z)};
    box.add(p);
  }
  ModelResult result;
  result.vertices = mesh.vertices_m.size();
  ThinnedCloud cloud(options.max_truth_points);
  const Result<uint64_t> left_out = read_ply_points(truth_ply, [&](Vec3 p) {
    ++result.truth_points_file;
    if (box.near(p, kMargin_m)) cloud.add(p);
  });
  if (!left_out) return Error{left_out.error()};
  const std::vector<Vec3>& points = cloud.points();
  result.truth_points = points.size();
  if (points.empty())
    return Error{fmt::format(
        "{}: none of its {} points is within 0.5 m of the mesh; are both in the same frame and in "
        "metres? (--pose X,Y,Z,QX,QY,QZ,QW moves the mesh)",
        truth_ply, result.truth_points_file)};
  if (cloud.stride() > 1)
    result.warning = fmt::format(
        "the truth was thinned to every {}th point near the mesh to bound memory; distances to "
        "the nearest point are overstated",
        cloud.stride());
  else if (*left_out > 0)
    result.warning = fmt::format("{} points of the truth are not finite and were left out", *left_out);
  const PointSet set{points};
  const Tree tree(3, set, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  const std::vector<Distances> distances = all_distances(mesh.vertices_m, tree, points, options.threads);
  result.to_surface = summarise(distances, &Distances::to_surface_m);
  result.to_point = summarise(distances, &Distances::to_point_m);
  const auto on_plane =
      std::count_if(distances.begin(), distances.end(), [](const Distances& d) { return d.on_plane; });
  result.on_plane_share = static_cast<double>(on_plane) / static_cast<double>(distances.size());
  return result;
}

}  // namespace

Result<ModelResult> evaluate_model(const std::string& truth_ply, const std::string& mesh_ply,
                                   const ModelOptions& options) {
  try {
    Result<PlyMesh> mesh = read_ply_mesh(mesh_ply);
    if (!mesh) return Error{mesh.error()};
    if (mesh->vertices_m.empty())
      return Error{fmt::format("{}: holds no vertices, nothing to evaluate", mesh_ply)};
    mesh->triangles = {};
    thin(mesh->vertices_m, options.max_vertices);
    return evaluate_loaded(truth_ply, std::move(*mesh), options);
  } catch (const std::bad_alloc&) {
    return Error{
        fmt::format("{} against {}: out of memory; use a smaller mesh or cloud", mesh_ply, truth_ply)};
  }
}

std::string model_csv(const ModelResult& result) {
  std::string csv = "distance_m,share,share_to_point\n";
  for (std::size_t i = 0; i < kCurvePoints; ++i)
    csv += fmt::format("{:.3f},{:.6f},{:.6f}\n", static_cast<double>(i) * kCurveStep_m,
                       result.to_surface.curve[i], result.to_point.curve[i]);
  return csv;
}

}  // namespace stillmap
