#pragma once

#include <sys/uio.h>

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/view.hpp"

namespace stillmap {

/// What an event log asks of the system: files, and the time. Tests put a disk in its place that fills up,
/// breaks, or forgets what was not synced.
/// Calls that return int: 0, or the system's error number.
/// @thread one; list allocates, nothing else does; none throws
class LogDisk {
 public:
  struct Entry {
    std::string name;
    uint64_t bytes = 0;
  };

  virtual ~LogDisk() = default;

  /// Regular files of the folder, in any order; made where it is not there.  @thread boot
  virtual int list(const std::string& folder, std::vector<Entry>& entries) = 0;
  /// A new, empty file. @return its number, 0 or more; below 0: minus the system's error number
  virtual int create(const char* path) = 0;
  /// Appends all of the pieces, or as much as there is room for. @param pieces are changed
  virtual int append(int file, View<iovec> pieces) = 0;
  /// Cuts the file off behind `bytes`.
  virtual int cut(int file, uint64_t bytes) = 0;
  /// What was appended survives a power cut from here on.
  virtual int sync(int file) = 0;
  virtual int close(int file) = 0;
  virtual int rename(const char* from, const char* to) = 0;
  virtual int remove(const char* path) = 0;
  /// The names in the folder survive a power cut from here on.
  virtual int sync_folder(const char* folder) = 0;
  /// CLOCK_MONOTONIC
  virtual int64_t now_ns() = 0;
};

/// The real one. @thread any; stateless
LogDisk& system_disk();

}  // namespace stillmap
