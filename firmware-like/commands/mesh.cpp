#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>

#include "firmware-like/commands/command.hpp"
#include "runtime/archive/map_file.hpp"
#include "runtime/record/ply_writer.hpp"

namespace stillmap {
namespace {

struct MeshOptions {
  std::string map, out;
  int32_t threads = 2;
};

/// An engine with room for what the file holds; no camera is needed, so it has the smallest.
EngineParams params_for(const MapFile& file, int32_t threads) {
  constexpr uint64_t kBlocksPerGroup = 4, kPartlyPerBlock = 1, kSpare = 1024;  // of the engine's pools
  const MapContents& has = file.contents();
  const uint64_t blocks = kSpare + std::max({has.voxel_blocks, kBlocksPerGroup * has.groups,
                                             has.partly_blocks / kPartlyPerBlock});
  EngineParams params;
  params.camera.k = {80, 80, 39.5f, 29.5f, 80, 60};
  params.map.voxel_m = file.info().voxel_m;
  params.map.truncation_m = file.info().truncation_m;
  params.map.free_space = FreeSpace::hierarchical;
  params.map.mesh_min_weight = file.info().mesh_min_weight;
  params.map.mesh_min_surface = file.info().mesh_min_surface;
  params.integrate.weight_cap = file.info().weight_cap;
  params.map.pool_blocks = static_cast<int32_t>(std::min<uint64_t>(blocks, kMaxPoolBlocks));
  params.threads = threads;
  return params;
}

struct MeshCounts {
  uint64_t vertices = 0, triangles = 0;
};

Result<MeshCounts> make_mesh(const MeshOptions& o) {
  auto file = MapFile::open(o.map);
  if (!file) return Error{file.error(), file.error_kind()};
  const std::unique_ptr<Engine> engine = make_cpu_engine(params_for(*file, o.threads));
  if (!engine)
    return Error{fmt::format("{}: its {} blocks do not fit into this machine's memory", o.map,
                             file->contents().voxel_blocks)};
  if (const auto loaded = file->load(*engine); !loaded) return Error{loaded.error(), loaded.error_kind()};
  PlyWriter writer(o.out);
  const Status status = engine->extract_mesh(writer);
  const bool written = writer.close();
  if (status != Status::ok && writer.error().empty())
    return Error{fmt::format("{}: the mesh could not be extracted: {}", o.map, to_string(status))};
  if (!written) return Error{writer.error()};
  return MeshCounts{writer.vertex_count(), writer.triangle_count()};
}

int print_mesh(const MeshOptions& o) {
  const auto made = make_mesh(o);
  if (!made) return fail(made.error(), made.error_kind());
  fmt::print("{}: {} vertices, {} triangles\n", o.out, made->vertices, made->triangles);
  return kExitDone;
}

}  // namespace

std::string mesh_of_map(const std::string& map_path, const std::string& mesh_path) {
  const auto made = make_mesh({map_path, mesh_path, 1});
  return made ? std::string() : made.error();
}

void add_mesh(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("mesh", "mesh of a saved map");
  auto options = std::make_shared<MeshOptions>();
  command->add_option("MAP", options->map, "map.smap of a run")->required();
  command->add_option("--out", options->out, "MESH.ply")->required();
  command->add_option("--threads", options->threads, "of the extraction")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->callback([options, &exit_code] { exit_code = print_mesh(*options); });
}

}  // namespace stillmap
