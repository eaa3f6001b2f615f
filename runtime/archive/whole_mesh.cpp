#include "runtime/archive/whole_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "kernels/backend/cpu/extract.hpp"
#include "kernels/backend/cpu/map_storage.hpp"
#include "kernels/map/group_record.hpp"

namespace stillmap {
namespace {

/// Room for the groups that hold only a block or two. Pages that nothing is written to take no disk.
constexpr uint64_t kRoom = 4;
constexpr uint64_t kLeastBlocks = 4096;

/// A map in a file, with what extraction needs.
struct FileMap {
  MapStorage map;
  View<uint8_t> scratch;

  void carve(Arena& arena, const EngineParams& params) {
    map.carve(arena, params.map, params.integrate.weight_cap);
    scratch =
        arena.take<uint8_t>("mesh", extract_scratch_bytes(static_cast<uint32_t>(params.map.pool_blocks)));
  }
};

/// Puts every group of the map and of the archive into `out`. @return what went wrong, else nothing
std::string gather(Engine& engine, BlockArchive& archive, MapStorage& out) {
  Status status = Status::ok;
  const auto put = [&](View<const uint8_t> record) {
    status = out.read_group(record);
    return status == Status::ok;
  };
  // The archive first: while it empties its queues groups may come back to the map.
  if (std::string error = archive.for_each(engine, put); !error.empty()) return error;
  std::vector<uint64_t> keys(engine.list_groups({}));
  engine.list_groups({keys.data(), static_cast<uint32_t>(keys.size())});
  std::vector<uint8_t> record(kMaxGroupRecordBytes);
  for (size_t i = 0; i < keys.size() && status == Status::ok; ++i) {
    const uint32_t bytes = engine.write_group(keys[i], {record.data(), kMaxGroupRecordBytes});
    if (bytes > 0) put({record.data(), bytes});
  }
  return status == Status::ok ? std::string() : fmt::format("the whole map: {}", to_string(status));
}

}  // namespace

std::string extract_whole_mesh(Engine& engine, BlockArchive& archive, const EngineParams& params,
                               const std::string& dir, MeshSink& sink) {
  EngineParams whole = params;
  const uint64_t blocks = engine.map_health().blocks + archive.counters().bytes / sizeof(VoxelBlock);
  whole.map.pool_blocks =
      static_cast<int32_t>(std::min<uint64_t>(kRoom * blocks + kLeastBlocks, kMaxPoolBlocks));
  Arena measure;
  FileMap{}.carve(measure, whole);
  Arena arena(measure.items().total_bytes, dir.c_str());
  if (arena.failed())
    return fmt::format(
        "{}: no file for the mesh of the whole map ({} MB, most of them empty) can be made there", dir,
        measure.items().total_bytes / 1000000);
  FileMap file;
  file.carve(arena, whole);
  file.map.clear();
  if (std::string error = gather(engine, archive, file.map); !error.empty()) return error;
  ThreadPool threads(params.threads);
  const Status status = extract_mesh(file.map.view(), sink, file.scratch, threads);
  return status == Status::ok ? std::string()
                              : fmt::format("the mesh of the whole map: {}", to_string(status));
}

}  // namespace stillmap
