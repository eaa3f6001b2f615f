#pragma once

#include "tests/parity/engines.hpp"
#include "tests/parity/report.hpp"
#include "tests/parity/scene.hpp"

namespace stillmap::parity {

/// Every step of `candidate` beside the reference: both get the same frames and poses, frame by frame; then a
/// view and the mesh of the two maps.
void check_steps(const NamedEngine& reference, const NamedEngine& candidate, const Scene& scene,
                 Report& report);

/// Poses of an engine that goes its own way through the scene.
struct Trajectory {
  std::vector<Se3> T_first_cam;
  double ms = 0;
};
/// Empty when the engine cannot be made.
Trajectory run_whole(const NamedEngine& engine, const Scene& scene);

/// The reference's own poses against the truth, and the candidate's against the reference's.
void check_whole(const NamedEngine& reference, const NamedEngine* candidate, const Scene& scene,
                 const Trajectory& reference_run, double truth_limit_m, Report& report);

}  // namespace stillmap::parity
