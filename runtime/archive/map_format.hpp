#pragma once

// A map on disk, little-endian:
//   FileHead              every version begins with it
//   chunks                ChunkHead, a zstd frame of packed_bytes, CRC-32C of the file up to here
// The first chunk is info (InfoRecord), then groups and places, the last is end (EndRecord), and nothing
// follows it. Groups and places hold records one after the other: a length (uint32), then a group
// (kernels/map/group_record.hpp) or a keyframe (kernels/relocalise/place_record.hpp).
// Every checksum goes on from the one before it: the last is that of the whole file, and a chunk that was
// lost, moved or put in from another file is seen.

#include <cstdint>
#include <type_traits>

#include "kernels/base/se3.hpp"
#include "kernels/map/group_record.hpp"
#include "kernels/relocalise/place_record.hpp"

namespace stillmap {

/// Like PNG: a transfer that cuts the eighth bit or turns line ends shows in the first bytes.
inline constexpr uint8_t kMapMagic[8] = {0x89, 'S', 'M', 'A', 'P', '\r', '\n', 0x1a};
inline constexpr uint32_t kMapFormatVersion = 1;

struct FileHead {
  uint8_t magic[8];
  uint32_t format_version;
  uint32_t checksum;  ///< CRC-32C of what is before it: a newer version is told from a damaged one
};
static_assert(sizeof(FileHead) == 16);

enum class ChunkKind : uint32_t { info = 1, groups, places, end };

struct ChunkHead {
  ChunkKind kind;
  uint32_t packed_bytes;  ///< in the file
  uint32_t plain_bytes;   ///< unpacked
};
static_assert(sizeof(ChunkHead) == 12);

/// A chunk is closed when it holds as much; the record that closes it goes over that.
inline constexpr uint32_t kChunkBytes = 512 * 1024;
inline constexpr uint32_t kMaxRecordBytes =
    kMaxGroupRecordBytes > kMaxPlaceRecordBytes ? kMaxGroupRecordBytes : kMaxPlaceRecordBytes;
inline constexpr uint32_t kMaxChunkBytes =
    kChunkBytes + kMaxRecordBytes + static_cast<uint32_t>(sizeof(uint32_t));

struct InfoRecord {
  Se3d T_map_cam;    ///< pose to continue from
  int64_t stamp_ns;  ///< of the frame with that pose
  float voxel_m, truncation_m;
  int32_t free_space;  ///< FreeSpace
  int32_t mesh_min_weight, mesh_min_surface, weight_cap;
  char program_version[24];  ///< ends with a zero
};
static_assert(sizeof(InfoRecord) == 96 + 8 + 24 + 24 && std::is_trivially_copyable_v<InfoRecord>);

struct EndRecord {
  uint64_t groups, places;  ///< in the file
};

}  // namespace stillmap
