#include "drivers/openni2/recording_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

namespace stillmap::openni2 {
namespace {

// The file: a header, then records, each with a header of its own; numbers are little-endian.
constexpr size_t kFileHeaderBytes = 24;
constexpr char kFileMagic[] = {'N', 'I', '1', '0'};
constexpr uint32_t kRecordMagic = 0x0052494E;  // "NIR"
constexpr size_t kRecordHeaderBytes = 28, kOldRecordHeaderBytes = 24;
constexpr uint32_t kFirstWideVersion = 0x010001;  ///< since then positions have 64 bits
constexpr uint32_t kLeastType = 2, kData = 10, kEnd = 11, kSeekTable = 14;
constexpr uint32_t kMostFieldBytes = 1u << 20;
constexpr uint32_t kMostImageBytes = 1600 * 1200 * 3;  ///< the player has no room for more

class File {
 public:
  explicit File(const std::string& path) : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor_ < 0 || ::fstat(descriptor_, &about_) != 0) error_ = errno;
  }
  ~File() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  int error() const { return error_; }
  bool is_regular() const { return S_ISREG(about_.st_mode); }
  uint64_t size() const { return static_cast<uint64_t>(about_.st_size); }
  /// @return false: the file ends before
  bool read(uint64_t at, void* to, size_t bytes) const {
    return ::pread(descriptor_, to, bytes, static_cast<off_t>(at)) == static_cast<ssize_t>(bytes);
  }

 private:
  int descriptor_;
  struct stat about_ {};
  int error_ = 0;
};

struct RecordHeader {
  uint32_t magic = 0, type = 0, node = 0;
  uint32_t own_bytes = 0;  ///< header and fields
  uint32_t payload_bytes = 0;
};

bool is_sound(const RecordHeader& record, size_t header_bytes) {
  if (record.magic != kRecordMagic || record.type < kLeastType || record.type > kSeekTable) return false;
  if (record.type == kSeekTable) return record.own_bytes >= header_bytes;
  return record.own_bytes >= header_bytes && record.own_bytes <= kMostFieldBytes &&
         record.payload_bytes <= (record.type == kData ? kMostImageBytes : kMostFieldBytes);
}

/// From the first record to the one that ends the file; what is behind that does not matter.
std::string records_problem(const std::string& path, const File& file, size_t header_bytes) {
  uint64_t at = kFileHeaderBytes;
  while (true) {
    RecordHeader record;
    static_assert(sizeof record == 20);
    if (!file.read(at, &record, sizeof record))
      return path + ": is cut off at byte " + std::to_string(file.size()) +
             ": the recording was not ended, or the copy is not complete";
    if (!is_sound(record, header_bytes)) return path + ": is damaged at byte " + std::to_string(at);
    if (record.type == kEnd) return {};
    at += uint64_t{record.own_bytes} + record.payload_bytes;
  }
}

}  // namespace

std::string recording_problem(const std::string& path) {
  const File file(path);
  if (file.error() == ENOENT) return path + ": there is no such file";
  if (file.error() != 0) return path + ": cannot be read (" + std::strerror(file.error()) + ")";
  if (!file.is_regular()) return path + ": is no file; expected a recording of OpenNI2 (.oni)";
  std::array<uint8_t, kFileHeaderBytes> header;
  if (!file.read(0, header.data(), header.size()) ||
      std::memcmp(header.data(), kFileMagic, sizeof kFileMagic) != 0)
    return path + ": is no recording of OpenNI2 (.oni)";
  const uint32_t version = uint32_t{header[4]} << 16 | uint32_t{header[5]} << 8 | header[6];
  return records_problem(path, file,
                         version < kFirstWideVersion ? kOldRecordHeaderBytes : kRecordHeaderBytes);
}

}  // namespace stillmap::openni2
