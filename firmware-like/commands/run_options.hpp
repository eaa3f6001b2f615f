#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "kernels/base/se3.hpp"

namespace CLI {
class App;
}

namespace stillmap {

/// The flags of `stillmap run` as they were typed.
struct RunOptions {
  std::string source, config, out, map, device = "auto", lcm, camera, initial_pose;
  std::string threads, depth_scale, time_offset_ms;  ///< "": not given
  uint32_t max_frames = 0;                           ///< 0: all
  uint32_t skip_frames = 0;
  std::vector<std::string> settings;
  bool realtime = false, quiet = false;
  uint32_t loop_frames = 0;  ///< no flag: so many frames are read at boot and then played to and fro for ever
};

/// What a run needs to know, checked.
struct RunPlan {
  Config config;
  Se3d T_map_cam;  ///< pose of the first frame
};

void declare_run_flags(CLI::App& command, RunOptions& options);

/// Configuration file, then --set, then the other flags; then every rule.
/// @return an error of kind bad_usage: which flag or key, what was expected
Result<RunPlan> plan_run(const RunOptions& options);

/// "FX,FY,CX,CY[,K1,K2,P1,P2,K3]" into config.camera.
Result<Done> apply_camera(Config& config, const std::string& text);

}  // namespace stillmap
