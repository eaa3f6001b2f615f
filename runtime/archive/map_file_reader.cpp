#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zstd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include "config/fields.hpp"
#include "runtime/archive/map_file.hpp"
#include "runtime/core/crc32c.hpp"

namespace stillmap {
namespace {

constexpr size_t kMaxPackedBytes = ZSTD_COMPRESSBOUND(kMaxChunkBytes);

bool is_pose(const Se3d& T) {
  constexpr double kRounding = 1e-6;
  const Mat3T<double> unit = T.rotation * transposed(T.rotation);
  for (int32_t i = 0; i < 9; ++i)
    if (!(std::fabs(unit.m[i] - (i % 4 == 0 ? 1.0 : 0.0)) < kRounding)) return false;
  return std::isfinite(norm(T.translation));
}

bool makes_sense(const InfoRecord& r) {
  return is_pose(r.T_map_cam) && r.voxel_m > 0 && r.truncation_m > 0 && std::isfinite(r.voxel_m) &&
         std::isfinite(r.truncation_m) && r.free_space >= 0 &&
         r.free_space <= static_cast<int32_t>(FreeSpace::hierarchical) &&
         std::memchr(r.program_version, 0, sizeof r.program_version) != nullptr;
}

MapInfo from_record(const InfoRecord& r) {
  MapInfo info = {r.T_map_cam,
                  Stamp{r.stamp_ns},
                  r.voxel_m,
                  r.truncation_m,
                  static_cast<FreeSpace>(r.free_space),
                  r.mesh_min_weight,
                  r.mesh_min_surface,
                  r.weight_cap,
                  {}};
  std::memcpy(info.program_version, r.program_version, sizeof info.program_version);
  return info;
}

const char* name_of(FreeSpace free_space) {
  return free_space == FreeSpace::dense ? "dense" : "hierarchical";
}

}  // namespace

void ZstdUnpacker::operator()(ZSTD_DCtx_s* context) const {
  ZSTD_freeDCtx(context);
}

MapFile::MapFile(std::string path, int fd)
    : path_(std::move(path)),
      fd_(fd),
      unpacker_(ZSTD_createDCtx()),
      packed_(new uint8_t[kMaxPackedBytes]),
      plain_(new uint8_t[kMaxChunkBytes]) {}

MapFile::MapFile(MapFile&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      at_(other.at_),
      checksum_(other.checksum_),
      unpacker_(std::move(other.unpacker_)),
      packed_(std::move(other.packed_)),
      plain_(std::move(other.plain_)),
      info_(other.info_),
      contents_(other.contents_) {}

MapFile::~MapFile() {
  if (fd_ >= 0) ::close(fd_);
}

Result<MapFile> MapFile::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return Error{path + ": cannot be read: " + std::strerror(errno), ErrorKind::bad_usage};
  MapFile file(path, fd);
  if (!file.unpacker_) return Error{path + ": cannot be read: no memory to unpack it"};
  if (const auto good = file.verify(); !good) return Error{good.error(), good.error_kind()};
  return file;
}

Error MapFile::damaged(const std::string& what) const {
  return {fmt::format("{}: the map is damaged or cut off at byte {}: {}; nothing of it was loaded", path_,
                      at_, what)};
}

/// `count` bytes from where the last ones ended, taken into the checksum.
Result<Done> MapFile::read_bytes(void* to, size_t count) {
  auto* out = static_cast<uint8_t*>(to);
  for (size_t done = 0; done < count;) {
    const ssize_t n = ::pread(fd_, out + done, count - done, static_cast<off_t>(at_ + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return Error{path_ + ": cannot be read: " + std::strerror(errno), ErrorKind::bad_usage};
    if (n == 0) return damaged("the file ends too early");
    done += static_cast<size_t>(n);
  }
  checksum_ = crc32c(to, count, checksum_);
  at_ += count;
  return Done{};
}

Result<Done> MapFile::read_head() {
  FileHead head;
  at_ = checksum_ = 0;
  if (const auto read = read_bytes(&head, sizeof head); !read) return read;
  if (std::memcmp(head.magic, kMapMagic, sizeof head.magic) != 0)
    return Error{path_ + ": is not a map of stillmap (map.smap), or its first bytes are damaged",
                 ErrorKind::bad_usage};
  if (head.checksum != crc32c(&head, offsetof(FileHead, checksum))) return damaged("checksum of the head");
  if (head.format_version != kMapFormatVersion)
    return Error{fmt::format("{}: has format version {}, this program reads version {}: load it with the "
                             "program that wrote it, or a newer one",
                             path_, head.format_version, kMapFormatVersion),
                 ErrorKind::bad_usage};
  return Done{};
}

Result<MapFile::Chunk> MapFile::read_chunk() {
  ChunkHead head;
  if (const auto read = read_bytes(&head, sizeof head); !read) return Error{read.error(), read.error_kind()};
  if (head.packed_bytes > kMaxPackedBytes || head.plain_bytes > kMaxChunkBytes)
    return damaged("a length that no chunk has");
  if (const auto read = read_bytes(packed_.get(), head.packed_bytes); !read)
    return Error{read.error(), read.error_kind()};
  const uint32_t expected = checksum_;
  uint32_t checksum = 0;
  if (const auto read = read_bytes(&checksum, sizeof checksum); !read)
    return Error{read.error(), read.error_kind()};
  if (checksum != expected) return damaged("checksum");
  const size_t plain =
      ZSTD_decompressDCtx(unpacker_.get(), plain_.get(), head.plain_bytes, packed_.get(), head.packed_bytes);
  if (plain != head.plain_bytes) return damaged("a chunk that cannot be unpacked");
  return Chunk{head.kind, {plain_.get(), head.plain_bytes}};
}

Result<Done> MapFile::read_info() {
  const auto chunk = read_chunk();
  if (!chunk) return Error{chunk.error(), chunk.error_kind()};
  InfoRecord record;
  if (chunk->kind != ChunkKind::info || chunk->plain.size != sizeof record)
    return damaged("the description of the map is missing");
  std::memcpy(&record, chunk->plain.data, sizeof record);
  if (!makes_sense(record)) return damaged("the description of the map makes no sense");
  info_ = from_record(record);
  return Done{};
}

/// Calls `see` with each record of a chunk while it answers well.
template <class See>
Result<Done> MapFile::each_record(const Chunk& chunk, See&& see) {
  for (uint32_t from = 0; from < chunk.plain.size;) {
    uint32_t length = 0;
    if (chunk.plain.size - from < sizeof length) return damaged("a record that ends too early");
    std::memcpy(&length, chunk.plain.data + from, sizeof length);
    from += static_cast<uint32_t>(sizeof length);
    if (length > chunk.plain.size - from) return damaged("a record that ends too early");
    if (const auto good = see(View<const uint8_t>{chunk.plain.data + from, length}); !good) return good;
    from += length;
  }
  return Done{};
}

/// Reads the file from its start and calls `see` with each chunk after the first, the end included.
template <class See>
Result<Done> MapFile::each_chunk(See&& see) {
  if (const auto head = read_head(); !head) return head;
  if (const auto info = read_info(); !info) return info;
  while (true) {
    const auto chunk = read_chunk();
    if (!chunk) return Error{chunk.error(), chunk.error_kind()};
    if (const auto good = see(*chunk); !good) return good;
    if (chunk->kind == ChunkKind::end) return Done{};
  }
}

/// What can be known without an engine.
Result<Done> MapFile::check_record(const Chunk& chunk, View<const uint8_t> record) {
  if (chunk.kind == ChunkKind::places) {
    ++contents_.places;
    return Done{};
  }
  GroupRecordHead head;
  if (record.size < sizeof head) return damaged("a group that is too short");
  std::memcpy(&head, record.data, sizeof head);
  if (head.bytes != record.size) return damaged("a group of another length than it says");
  ++contents_.groups;
  for (const uint8_t kind : head.kind) {
    contents_.voxel_blocks += static_cast<BlockKind>(kind) == BlockKind::voxels;
    contents_.partly_blocks += static_cast<BlockKind>(kind) == BlockKind::partly;
  }
  return Done{};
}

Result<Done> MapFile::check_end(const Chunk& chunk) {
  EndRecord end;
  if (chunk.plain.size != sizeof end) return damaged("the end");
  std::memcpy(&end, chunk.plain.data, sizeof end);
  if (end.groups != contents_.groups || end.places != contents_.places)
    return damaged(fmt::format("{} groups and {} keyframes where {} and {} were written", contents_.groups,
                               contents_.places, end.groups, end.places));
  uint8_t more = 0;
  if (::pread(fd_, &more, 1, static_cast<off_t>(at_)) != 0) return damaged("something follows the end");
  contents_.file_bytes = at_;
  return Done{};
}

Result<Done> MapFile::verify() {
  return each_chunk([&](const Chunk& chunk) -> Result<Done> {
    if (chunk.kind == ChunkKind::end) return check_end(chunk);
    if (chunk.kind != ChunkKind::groups && chunk.kind != ChunkKind::places)
      return damaged("a chunk of unknown kind");
    return each_record(chunk, [&](View<const uint8_t> record) { return check_record(chunk, record); });
  });
}

Result<Done> MapFile::check_against(const Config& config) const {
  std::string problems;
  const auto differs = [&](const char* key, const std::string& in_map, const std::string& in_config) {
    problems += fmt::format("\n  {0} is {1} in the map and {2} in the configuration: use --set {0}={1}", key,
                            in_map, in_config);
  };
  const MapParams& map = config.map;
  if (info_.voxel_m != map.voxel_m)
    differs("map.voxel_m", float_text(info_.voxel_m), float_text(map.voxel_m));
  if (info_.truncation_m != map.truncation_m)
    differs("map.truncation_m", float_text(info_.truncation_m), float_text(map.truncation_m));
  if (contents_.partly_blocks > 0 && map.free_space == FreeSpace::dense)
    differs("map.free_space", name_of(info_.free_space), name_of(map.free_space));
  if (config.archive.dir.empty() && contents_.voxel_blocks > static_cast<uint64_t>(map.pool_blocks))
    problems += fmt::format(
        "\n  it has {} blocks and map.pool_blocks is {}: use --set map.pool_blocks={}, or --set "
        "archive.dir=FOLDER",
        contents_.voxel_blocks, map.pool_blocks, contents_.voxel_blocks + contents_.voxel_blocks / 2);
  if (problems.empty()) return Done{};
  return Error{fmt::format("{}: the map cannot be gone on with:{}\n  or leave --map out", path_, problems),
               ErrorKind::bad_usage};
}

Result<Done> MapFile::put(const Chunk& chunk, View<const uint8_t> record, Engine& engine,
                          BlockArchive* archive, LoadedMap& loaded) {
  if (chunk.kind == ChunkKind::groups) {
    if (archive)
      if (const std::string error = archive->make_room(engine, cast<float>(info_.T_map_cam).translation);
          !error.empty())
        return Error{path_ + ": " + error};
    const Status status = engine.read_group(record);
    if (status == Status::capacity_exhausted)
      return Error{path_ + ": the map does not fit; make map.pool_blocks or archive.max_bytes larger",
                   ErrorKind::bad_usage};
    if (status != Status::ok) return damaged("a group that the engine refuses");
    return Done{};
  }
  const Status status = engine.read_place(record);
  if (status == Status::bad_data) return damaged("a keyframe that the engine refuses");
  ++(status == Status::ok ? loaded.places : loaded.foreign_places);
  return Done{};
}

Result<LoadedMap> MapFile::load(Engine& engine, BlockArchive* archive) {
  engine.reset_map();
  LoadedMap loaded;
  const auto good = each_chunk([&](const Chunk& chunk) -> Result<Done> {
    if (chunk.kind == ChunkKind::end) return Done{};
    return each_record(
        chunk, [&](View<const uint8_t> record) { return put(chunk, record, engine, archive, loaded); });
  });
  if (good) return loaded;
  engine.reset_map();
  return Error{good.error(), good.error_kind()};
}

}  // namespace stillmap
