#pragma once

// How far a mesh lies from the true surface: the paper's figure of cumulative distances (section IV-C).

#include <array>
#include <cstdint>
#include <string>

#include "config/result.hpp"
#include "kernels/base/se3.hpp"
#include "runtime/evaluate/statistics.hpp"

namespace stillmap {

inline constexpr int kCurvePoints = 101;
inline constexpr double kCurveStep_m = 0.002;  ///< the curve goes from 0 to 0.2 m

/// Distances of all vertices of a mesh to the truth, in one way of measuring.
struct DistanceSummary {
  Statistics distance_m;
  std::array<double, kCurvePoints> curve{};  ///< share of vertices within i * kCurveStep_m
  double within_1cm = 0, within_2cm = 0, within_5cm = 0;
  double ghosts = 0;  ///< share of vertices farther than 10 cm
};

/// `to_surface` is the figure to use. A vertex that lies between the samples of a truth cloud of 1 cm is some
/// 4 mm from the nearest of them though it lies on the surface. Therefore, where the nearest eight points are
/// within 3 cm and form a plane, the distance to that plane counts (never more than the distance to the
/// nearest point).
struct ModelResult {
  DistanceSummary to_surface;
  DistanceSummary to_point;  ///< plain distance to the nearest point of the cloud
  uint64_t vertices = 0;
  uint64_t truth_points = 0;  ///< used
  uint64_t truth_points_file = 0;
  double on_plane_share = 0;  ///< share of vertices measured against a plane
  std::string warning;        ///< one line, empty when there is nothing to say
};

struct ModelOptions {
  Se3d T_truth_mesh;  ///< mesh to truth
  uint64_t max_truth_points =
      20'000'000;                      ///< bounds memory (about 30 bytes each); above it the cloud is thinned
  uint64_t max_vertices = UINT64_MAX;  ///< of a larger mesh every n-th vertex is measured
  int32_t threads = 0;                 ///< 0: as many as the machine has
};

/// Truth farther than 0.5 m from the mesh's box is not loaded.
/// @return an error naming file and reason; also when no truth is near the mesh.  test: model_test
Result<ModelResult> evaluate_model(const std::string& truth_ply, const std::string& mesh_ply,
                                   const ModelOptions& options = {});

/// `distance_m,share,share_to_point`, a line for each step of the curve.
std::string model_csv(const ModelResult& result);

}  // namespace stillmap
