#pragma once

// The hot loops. loops.cpp is compiled once for each instruction set; the engine picks a table when it is
// made.

#include <cstdint>
#include <memory>

#include "kernels/backend/cpu/kept_corners.hpp"
#include "kernels/complete/temporary_model.hpp"
#include "kernels/engine.hpp"
#include "kernels/integrate/depth_range.hpp"
#include "kernels/integrate/integrate_pass.hpp"
#include "kernels/integrate/visible_blocks.hpp"
#include "kernels/mask/cells.hpp"
#include "kernels/mask/residual_mask.hpp"
#include "kernels/mask/static_pixels.hpp"
#include "kernels/prepare/prepare_pixel.hpp"
#include "kernels/prepare/register_pixel.hpp"
#include "kernels/track/track_pass.hpp"

namespace stillmap {

struct CpuLoops {
  const char* name;
  /// @return pixels with a depth in range, rows [first, last)
  int32_t (*prepare)(const PreparePass&, int32_t first_row, int32_t last_row);
  /// All of an image.
  void (*register_depth)(const RegisterPass&, const ImageView<const uint16_t>& depth_raw,
                         const ImageView<uint16_t>& registered_raw);
  /// Sums over every `step`-th pixel of every `step`-th row in [first, last).
  /// @param kept of the same map; written, the rows looked at only. `step` is a multiple of its own
  NormalEqT<float> (*track)(const TrackPass&, const KeptCorners& kept, int32_t first_row, int32_t last_row,
                            int32_t step);
  void (*residual_mask)(const ResidualMaskPass&, int32_t first_row, int32_t last_row);
  void (*cell_depth)(const CellDepthPass&, int32_t first_row, int32_t last_row);
  void (*cell_normals)(const CellNormalPass&, int32_t first_row, int32_t last_row);
  void (*cell_evidence)(const CellEvidencePass&, int32_t first_row, int32_t last_row);
  void (*still_cells)(const StillPass&, int32_t first_row, int32_t last_row);
  void (*dynamic_pixels)(const DynamicPixelPass&, int32_t first_row, int32_t last_row);
  /// Of every `step`-th pixel of every `step`-th row in [first, last); `first` is a multiple of `step`.
  void (*trust)(const TrustPass&, int32_t first_row, int32_t last_row, int32_t step);
  void (*static_depth)(const StaticDepthPass&, int32_t tile_row);
  GroupView (*visible_group)(const VisibleGroupPass&, uint32_t group);
  void (*integrate)(const IntegratePass&, View<const VisibleBlock>);
  /// Of one frame of the model.
  void (*start_depth)(const StartDepthPass&, int32_t frame);
  void (*silent_cells)(const SilentCellPass&);
  void (*complete)(const CompletePass&, int32_t first_row, int32_t last_row);
};

extern const CpuLoops kLoopsBaseline;
#if defined(__x86_64__)
extern const CpuLoops kLoopsAvx2;
extern const CpuLoops kLoopsAvx512;  ///< eight lanes as well, with masks
#endif

/// Tables that this machine can run, the best one first; the last one is kLoopsBaseline.  @thread boot
View<const CpuLoops* const> runnable_loops();

/// Best table for this machine; STILLMAP_ISA in the environment names another one.  @thread
/// boot
const CpuLoops& best_loops();

/// make_cpu_engine with a given table, which the machine must be able to run.  @thread boot
std::unique_ptr<Engine> make_cpu_engine(const EngineParams& params, const CpuLoops& loops);

}  // namespace stillmap
