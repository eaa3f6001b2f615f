// Both forms of free space on the same scenes with the true poses: do they know the same points, and what
// does each take? Runs of their own poses are compared by `run` and `evaluate`.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/engine_params.hpp"
#include "drivers/registry.hpp"
#include "drivers/synthetic/synthetic_source.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "kernels/map/block_ref.hpp"
#include "runtime/record/truth_frame.hpp"

namespace stillmap {
namespace {

constexpr double kLeastAgreement = 0.999;
constexpr double kMostBytes = 1.25;        ///< of the blocks with a surface
constexpr float kPointEveryVoxels = 1.7f;  ///< not a divisor of a block: all places in a block are met

struct Agreement {
  std::string scene;
  uint64_t points = 0, equal = 0;
  std::array<uint64_t, 3> known = {};  ///< by PointState, in the dense form
  std::array<uint64_t, 2> bytes = {};  ///< dense, hierarchical
  uint32_t surface_blocks = 0;         ///< most blocks with voxels, hierarchical

  double share() const {
    return static_cast<double>(equal) / static_cast<double>(std::max<uint64_t>(points, 1));
  }
  double over_surface() const {
    return static_cast<double>(bytes[1]) / (static_cast<double>(surface_blocks) * sizeof(VoxelBlock));
  }
  bool reached() const { return points > 0 && share() > kLeastAgreement && over_surface() <= kMostBytes; }
};

/// Asks both maps for the points of a grid in every group that the dense one has.
void compare_groups(const Engine& dense, const Engine& lean, float voxel_m, Agreement& out) {
  std::vector<uint64_t> keys(dense.list_groups({}));
  dense.list_groups({keys.data(), static_cast<uint32_t>(keys.size())});
  const float step_m = kPointEveryVoxels * voxel_m, edge_m = voxel_m * kBlockEdge * kGroupEdge;
  std::vector<Vec3> points;
  std::vector<PointState> states[2];
  for (const uint64_t key : keys) {
    const Vec3 low = voxel_position(first_voxel(block_in_group(unpack(key), 0)), voxel_m);
    points.clear();
    for (float z = 0; z < edge_m; z += step_m)
      for (float y = 0; y < edge_m; y += step_m)
        for (float x = 0; x < edge_m; x += step_m) points.push_back(low + Vec3{x, y, z});
    const auto count = static_cast<uint32_t>(points.size());
    for (const int which : {0, 1}) {
      states[which].resize(count);
      (which ? lean : dense).look_up({points.data(), count}, {states[which].data(), count});
    }
    out.points += count;
    for (uint32_t i = 0; i < count; ++i) {
      out.equal += states[0][i] == states[1][i];
      ++out.known[static_cast<size_t>(states[0][i])];
    }
  }
}

/// @return what went wrong, else nothing
std::string compare(const Config& config, const std::string& source_name, Agreement& out) {
  auto source = open_source(source_name, source_options(config));
  if (!source) return source.error();
  EngineParams params = engine_params(config, (*source)->info().camera, (*source)->info().depth_units_per_m);
  std::unique_ptr<Engine> engines[2];
  for (const FreeSpace form : {FreeSpace::dense, FreeSpace::hierarchical}) {
    params.map.free_space = form;
    engines[form == FreeSpace::hierarchical] = make_cpu_engine(params);
  }
  if (!engines[0] || !engines[1]) return "the memory of two maps cannot be had; lower map.pool_blocks";
  FrameSlot slot((*source)->info());
  TruthFrame truth;
  while ((*source)->next(slot.frame(), 1000) == Status::ok && !stop_requested()) {
    const RgbdFrame& frame = slot.frame();
    if (!frame.truth_T_world_cam) return source_name + ": has no true poses";
    truth.anchor({}, *frame.truth_T_world_cam);
    const Se3 T_map_cam = cast<float>(truth.to_map(*frame.truth_T_world_cam));
    for (const auto& engine : engines) {
      if (engine->prepare({frame.depth_raw, frame.colour}).status != Status::ok) continue;
      engine->mask(T_map_cam);
      if (engine->integrate(T_map_cam).status == Status::capacity_exhausted)
        return source_name + ": the map is full; raise map.pool_blocks";
    }
  }
  for (const int which : {0, 1}) out.bytes[static_cast<size_t>(which)] = engines[which]->map_health().bytes;
  out.surface_blocks = engines[1]->map_health().peak_blocks;
  compare_groups(*engines[0], *engines[1], params.map.voxel_m, out);
  return {};
}

nlohmann::ordered_json json_row(const Agreement& a) {
  return {{"scene", a.scene},
          {"points", a.points},
          {"equal", a.equal},
          {"unknown", a.known[0]},
          {"free", a.known[1]},
          {"occupied", a.known[2]},
          {"dense_bytes", a.bytes[0]},
          {"hierarchical_bytes", a.bytes[1]},
          {"surface_blocks", a.surface_blocks}};
}

}  // namespace

int bench_free_space(const BenchOptions& o) {
  catch_stop_signals();
  const auto config = read_config(o.configs.empty() ? "" : o.configs[0], o.settings);
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(good.error(), good.error_kind());
  const std::vector<std::string> scenes = o.sources.empty() ? synthetic_scene_names() : o.sources;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  bool reached = true;
  if (!o.json)
    fmt::print("{:<26} {:>10} {:>9} {:>8} {:>8} {:>8} {:>9} {:>9} {:>14} {:>12}\n", "scene", "points",
               "equal", "unknown", "free", "occup.", "dense MB", "hier. MB", "of the surface",
               "of the dense");
  for (const std::string& scene : scenes) {
    if (stop_requested()) break;
    const std::string size = o.size.empty() ? "160x120" : o.size;
    const bool plain = scene.find(':') == std::string::npos;
    std::string name = plain ? fmt::format("synthetic:{},size={}", scene, size) : scene;
    if (plain && !o.seconds.empty()) name += ",seconds=" + o.seconds;
    Agreement a;
    a.scene = scene;
    if (const std::string error = compare(*config, name, a); !error.empty())
      return fail(error, ErrorKind::failed);
    reached = reached && a.reached();
    rows.push_back(json_row(a));
    const auto percent = [&](uint64_t n) {
      return 100.0 * static_cast<double>(n) / static_cast<double>(a.points);
    };
    if (!o.json)
      fmt::print(
          "{:<26} {:>10} {:>8.3f}% {:>7.1f}% {:>7.1f}% {:>7.1f}% {:>9.1f} {:>9.1f} {:>14.3f} {:>12.3f}\n",
          a.scene, a.points, 100 * a.share(), percent(a.known[0]), percent(a.known[1]), percent(a.known[2]),
          1e-6 * static_cast<double>(a.bytes[0]), 1e-6 * static_cast<double>(a.bytes[1]), a.over_surface(),
          static_cast<double>(a.bytes[1]) / static_cast<double>(a.bytes[0]));
    std::fflush(stdout);
  }
  if (o.json) fmt::print("{}\n", rows.dump(2));
  return reached ? kExitDone : kExitFailed;
}

}  // namespace stillmap
