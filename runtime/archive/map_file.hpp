#pragma once

// map.smap: a map with all its layers (voxels, free space, keyframes), the parameters that it depends on and
// the pose to continue from.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "kernels/engine.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_format.hpp"
#include "runtime/ports/frame_source.hpp"
#include "runtime/record/output_file.hpp"

struct ZSTD_CCtx_s;  // of zstd.h
struct ZSTD_DCtx_s;

namespace stillmap {

/// What a map file says of its map, the map itself left out.
struct MapInfo {
  Se3d T_map_cam;  ///< where the camera was last: the first guess of where it is
  Stamp stamp;     ///< of that frame
  float voxel_m = 0, truncation_m = 0;
  FreeSpace free_space = FreeSpace::dense;
  int32_t mesh_min_weight = 0, mesh_min_surface = 0, weight_cap = 0;
  char program_version[24] = {};  ///< that wrote the file

  /// Of a map that is made with this configuration. @thread any; allocates nothing
  static MapInfo of(const Config& config, const Se3d& T_map_cam, Stamp stamp);
};

/// Counted while the file is verified.
struct MapContents {
  uint64_t groups = 0;         ///< of 4x4x4 blocks
  uint64_t voxel_blocks = 0;   ///< need a place in map.pool_blocks
  uint64_t partly_blocks = 0;  ///< without voxels, seen free in part
  uint64_t places = 0;         ///< keyframes of the search for a lost camera
  uint64_t file_bytes = 0;
};

/// How a map got into an engine.
struct LoadedMap {
  uint64_t places = 0;          ///< keyframes taken over
  uint64_t foreign_places = 0;  ///< not usable: of another image size or another relocalise.ferns
};

struct ZstdPacker {
  void operator()(ZSTD_CCtx_s* context) const;
};
struct ZstdUnpacker {
  void operator()(ZSTD_DCtx_s* context) const;
};

/// Writes PATH.part piece by piece and makes it PATH at the end, so that PATH is always whole: the file that
/// was there before, or this one. Memory: one chunk, whatever the size of the map.
/// @thread one
class MapFileWriter {
 public:
  /// @return one line with path and reason when the file cannot be written
  static Result<MapFileWriter> create(const std::string& path, const MapInfo& info);

  /// Records as map_format.hpp describes them, at most kMaxChunkBytes of one kind together.
  /// @param records how many they are  @return false: see error()
  bool write(ChunkKind kind, View<const uint8_t> bytes, uint64_t records);
  /// Syncs and renames. Without it the file is thrown away. @return false: see error()
  bool close();

  /// One line naming file and reason; empty while all is well.
  const std::string& error() const { return file_.error(); }
  uint64_t bytes() const { return bytes_; }  ///< written so far

 private:
  explicit MapFileWriter(OutputFile file);
  bool write_chunk(ChunkKind kind, View<const uint8_t> plain);
  bool put(const void* bytes, size_t count);

  OutputFile file_;
  std::unique_ptr<ZSTD_CCtx_s, ZstdPacker> packer_;
  std::vector<uint8_t> packed_;
  EndRecord counts_ = {};
  uint32_t checksum_ = 0;
  uint64_t bytes_ = 0;
};

/// A map file that was found whole.
/// @thread one
class MapFile {
 public:
  /// Reads all of the file and believes none of it: format, version, lengths, checksums, records, counts.
  /// Memory: one chunk. The file may be replaced (renamed over) afterwards without harm.
  /// @return an error with path, place and reason; kind bad_usage where the file is not there, is no map or
  /// is of a newer format, kind failed where it is damaged.                            test: map_file_test
  static Result<MapFile> open(const std::string& path);

  MapFile(MapFile&& other) noexcept;
  MapFile& operator=(MapFile&& other) = delete;
  ~MapFile();

  const MapInfo& info() const { return info_; }
  const MapContents& contents() const { return contents_; }

  /// @return an error of kind bad_usage with both values and what to do, where the map cannot be gone on with
  /// under this configuration
  Result<Done> check_against(const Config& config) const;
  /// Puts the map in place of the engine's. On an error the engine's map is empty.
  /// @param archive takes what is farthest from the pose to continue from where the pool is too small; may be
  /// null
  Result<LoadedMap> load(Engine& engine, BlockArchive* archive = nullptr);

 private:
  /// One chunk, unpacked; its bytes live until the next one is read.
  struct Chunk {
    ChunkKind kind;
    View<const uint8_t> plain;
  };

  MapFile(std::string path, int fd);
  Error damaged(const std::string& what) const;
  Result<Done> read_bytes(void* to, size_t count);
  Result<Done> read_head();
  Result<Chunk> read_chunk();
  Result<Done> read_info();
  Result<Done> check_record(const Chunk& chunk, View<const uint8_t> record);
  Result<Done> check_end(const Chunk& chunk);
  Result<Done> verify();
  Result<Done> put(const Chunk& chunk, View<const uint8_t> record, Engine& engine, BlockArchive* archive,
                   LoadedMap& loaded);
  template <class See>
  Result<Done> each_record(const Chunk& chunk, See&& see);
  template <class See>
  Result<Done> each_chunk(See&& see);

  std::string path_;
  int fd_ = -1;
  uint64_t at_ = 0;  ///< bytes of the file read
  uint32_t checksum_ = 0;
  std::unique_ptr<ZSTD_DCtx_s, ZstdUnpacker> unpacker_;
  std::unique_ptr<uint8_t[]> packed_, plain_;
  MapInfo info_;
  MapContents contents_;
};

}  // namespace stillmap
