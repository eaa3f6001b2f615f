#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "runtime/archive/map_file.hpp"
#include "runtime/core/crc32c.hpp"
#include "runtime/core/version.hpp"

namespace stillmap {
namespace {

/// Voxels are noisy: higher levels take much longer and gain a few percent.
constexpr int kPackLevel = 1;

template <class T>
View<const uint8_t> bytes_of(const T& value) {
  return {reinterpret_cast<const uint8_t*>(&value), sizeof value};
}

InfoRecord to_record(const MapInfo& info) {
  InfoRecord record = {info.T_map_cam,
                       info.stamp.ns,
                       info.voxel_m,
                       info.truncation_m,
                       static_cast<int32_t>(info.free_space),
                       info.mesh_min_weight,
                       info.mesh_min_surface,
                       info.weight_cap,
                       {}};
  std::memcpy(record.program_version, info.program_version, sizeof record.program_version);
  return record;
}

}  // namespace

MapInfo MapInfo::of(const Config& config, const Se3d& T_map_cam, Stamp stamp) {
  MapInfo info;
  info.T_map_cam = T_map_cam;
  info.stamp = stamp;
  info.voxel_m = config.map.voxel_m;
  info.truncation_m = config.map.truncation_m;
  info.free_space = config.map.free_space;
  info.mesh_min_weight = config.map.mesh_min_weight;
  info.mesh_min_surface = config.map.mesh_min_surface;
  info.weight_cap = config.integrate.weight_cap;
  const char* const text = version();
  std::memcpy(info.program_version, text, std::min(std::strlen(text), sizeof info.program_version - 1));
  return info;
}

void ZstdPacker::operator()(ZSTD_CCtx_s* context) const {
  ZSTD_freeCCtx(context);
}

MapFileWriter::MapFileWriter(OutputFile file)
    : file_(std::move(file)), packer_(ZSTD_createCCtx()), packed_(ZSTD_compressBound(kMaxChunkBytes)) {
  ZSTD_CCtx_setParameter(packer_.get(), ZSTD_c_compressionLevel, kPackLevel);
  ZSTD_CCtx_setParameter(packer_.get(), ZSTD_c_checksumFlag, 1);
}

Result<MapFileWriter> MapFileWriter::create(const std::string& path, const MapInfo& info) {
  auto file = OutputFile::create(path, OutputFile::Kind::whole);
  if (!file) return Error{file.error()};
  MapFileWriter writer(std::move(*file));
  if (!writer.packer_) return Error{path + ": cannot be written: no memory to pack it"};
  FileHead head = {};
  std::memcpy(head.magic, kMapMagic, sizeof head.magic);
  head.format_version = kMapFormatVersion;
  head.checksum = crc32c(&head, offsetof(FileHead, checksum));
  writer.put(&head, sizeof head);
  writer.write_chunk(ChunkKind::info, bytes_of(to_record(info)));
  if (!writer.error().empty()) return Error{writer.error()};
  return writer;
}

bool MapFileWriter::put(const void* bytes, size_t count) {
  checksum_ = crc32c(bytes, count, checksum_);
  bytes_ += count;
  return file_.write(bytes, count);
}

bool MapFileWriter::write_chunk(ChunkKind kind, View<const uint8_t> plain) {
  const size_t packed = ZSTD_compress2(packer_.get(), packed_.data(), packed_.size(), plain.data, plain.size);
  if (ZSTD_isError(packed)) return false;  // the output has room for the worst case
  const ChunkHead head = {kind, static_cast<uint32_t>(packed), plain.size};
  if (!put(&head, sizeof head) || !put(packed_.data(), packed)) return false;
  const uint32_t checksum = checksum_;
  return put(&checksum, sizeof checksum);
}

bool MapFileWriter::write(ChunkKind kind, View<const uint8_t> bytes, uint64_t records) {
  (kind == ChunkKind::groups ? counts_.groups : counts_.places) += records;
  return write_chunk(kind, bytes);
}

bool MapFileWriter::close() {
  return write_chunk(ChunkKind::end, bytes_of(counts_)) && file_.close();
}

}  // namespace stillmap
