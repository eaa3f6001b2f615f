#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "kernels/engine.hpp"

namespace stillmap::parity {

/// How far an engine may be from the reference. Lengths in metres, angles in rad, shares of pixels, blocks or
/// vertices.
struct Tolerance {
  double depth_m = 0;       ///< of any prepared pixel
  double colour_share = 0;  ///< prepared pixels that differ by more than one grey level
  double pose_m = 0;        ///< of one registration from the same start: the median frame ...
  double pose_rad = 0;
  double worst_pose_m = 0;  ///< ... and any: rounding can decide whether the last step is taken
  double worst_pose_rad = 0;
  double ratio = 0;       ///< inlier and mapped ratios
  double mask_share = 0;  ///< pixels masked by one only, at the same pose
  double blocks_share = 0;
  double view_share = 0;    ///< pixels of a view that differ by more than 2 mm or 4 grey levels
  double mesh_share = 0;    ///< vertices, triangles, area
  double mesh_m = 0;        ///< centre of all vertices
  double trajectory_m = 0;  ///< of any pose when each engine goes its own way
};

/// The same sums in another order, or with fused multiply-add.
inline constexpr Tolerance kRounding = {.depth_m = 1e-6,
                                        .colour_share = 1e-3,
                                        .pose_m = 5e-4,
                                        .pose_rad = 2e-4,
                                        .worst_pose_m = 5e-3,
                                        .worst_pose_rad = 2e-3,
                                        .ratio = 2e-3,
                                        .mask_share = 5e-3,
                                        .blocks_share = 2e-3,
                                        .view_share = 1e-2,
                                        .mesh_share = 5e-3,
                                        .mesh_m = 2e-3,
                                        .trajectory_m = 1e-2};
/// The same bits.
inline constexpr Tolerance kSameBits = {};

/// One way to make an engine.
struct NamedEngine {
  std::string name;
  Tolerance tolerance;
  std::function<std::unique_ptr<Engine>(const EngineParams&)> make;  ///< null when it cannot be had
};

/// All that this build and this machine have. The first is the reference: plain loops, one thread.
std::vector<NamedEngine> available_engines();
/// One line on what cannot be compared here, and why; "" when all can.
std::string engines_left_out();

}  // namespace stillmap::parity
