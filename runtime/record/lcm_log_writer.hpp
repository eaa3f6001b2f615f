#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "kernels/base/status.hpp"
#include "kernels/base/view.hpp"
#include "runtime/ports/messages.hpp"
#include "runtime/record/log_disk.hpp"

namespace stillmap {

struct LcmLogOptions {
  std::string dir;                  ///< made where it is not there
  std::string name = "log";         ///< of the files: DIR/NAME-000001.lcm and so on
  uint64_t max_bytes = 4000000000;  ///< of all files, at least twice file_bytes
  uint64_t file_bytes = 256000000;  ///< then the next file begins
  double file_s = 3600;             ///< so does it after so long
  double max_s = 0;                 ///< files that were closed so long ago are deleted; 0: however old
  double sync_s = 1;                ///< so often what was written is synced
};

/// Since the log was opened.
struct LcmLogCounters {
  uint64_t events = 0;   ///< written, those at the start of each file included
  uint64_t dropped = 0;  ///< not written: no room on the disk, a failure, longer than a file
  uint32_t stops = 0;    ///< times that writing had to stop
  uint32_t files_begun = 0;
  uint32_t files_deleted = 0;  ///< to stay within the bytes and the time
  uint32_t taken_over = 0;     ///< files that an earlier run did not close
  uint64_t bytes = 0;          ///< of all files now
};

/// Writes events into files that are rotated by size and time; the oldest are deleted, so that all files
/// together stay within max_bytes. The file that is being written ends in `.part`.
///
/// What is lost: when the program is killed nothing, for every event is with the system when `write` returns
/// (half an event at the end of a file is passed over by readers). When the power is cut, what came after the
/// last sync: at most sync_s, plus the time between two calls, plus the time that the disk takes to sync.
///
/// A full disk, or one that fails, stops the log: events are counted and dropped, one try a second is made,
/// and when it succeeds the log goes on. Events are numbered through all files of a run, dropped ones
/// included, so that readers see how many are missing.
/// @thread one; after boot nothing allocates or throws. A call may wait as long as the disk does.
class LcmLogWriter {
 public:
  static constexpr int64_t kRetryNs = 1'000'000'000;
  /// Files kept, whatever their size.
  static constexpr uint32_t kMaxFiles = 4096;

  /// Takes over what is there already: an unclosed file of an earlier run loses its `.part`, all count.
  /// @param disk outlives the writer  @return an error that names the folder and what to do.  @thread boot
  static Result<std::unique_ptr<LcmLogWriter>> open(const LcmLogOptions& options,
                                                    LogDisk& disk = system_disk());
  ~LcmLogWriter();
  LcmLogWriter(const LcmLogWriter&) = delete;
  LcmLogWriter& operator=(const LcmLogWriter&) = delete;

  /// An event that every file is to begin with.  @thread boot
  void begin_files_with(const std::string& channel, Utime utime, View<const uint8_t> payload);

  /// @param channel at most 63 bytes, ended by 0
  /// @return ok; capacity_exhausted: the disk is full; unavailable: it fails; out_of_range: longer than a
  /// file
  Status write(const char* channel, Utime utime, View<const uint8_t> payload);
  /// Syncs when it is due; some times a second, whether there was something to write or not.
  /// @return ok, or as `write`
  Status step();
  /// Closes the file that is being written; the next event begins another one.
  void rotate();
  /// Syncs and closes. @return false: something could not be written, ever; see error()
  bool close();

  /// ok, or why the log stands still.
  Status status() const { return status_; }
  /// One line on the last failure: which file, why, what to do; empty while there was none.
  const char* error() const { return error_; }
  const LcmLogCounters& counters() const { return counters_; }

 private:
  struct ClosedFile {
    uint32_t number = 0;
    uint64_t bytes = 0;
    int64_t closed_ns = 0;
  };
  struct Path {
    char text[1024];
  };

  LcmLogWriter(const LcmLogOptions& options, LogDisk& disk);
  std::string take_over();

  Status put(const char* channel, int64_t utime_us, View<const uint8_t> payload);
  bool file_is_done(uint64_t bytes) const;
  Status begin_file();
  void end_file();
  Status make_room();
  int delete_oldest();
  Status stop(const char* what, uint32_t file, int error);
  Path path(uint32_t number, bool open) const;

  const LcmLogOptions options_;
  LogDisk& disk_;
  std::string first_channel_;
  Utime first_utime_;
  std::vector<uint8_t> first_payload_;

  std::vector<ClosedFile>
      closed_;  ///< a ring: `closed_count_` of them from `closed_first_`, the oldest first
  uint32_t closed_first_ = 0, closed_count_ = 0;
  uint64_t closed_bytes_ = 0;

  uint32_t number_ = 0;  ///< of the open file, or the last one
  int file_ = -1;        ///< open; -1: none
  uint64_t file_bytes_ = 0, synced_bytes_ = 0;
  int64_t begun_ns_ = 0, sync_due_ns_ = 0, retry_ns_ = 0;
  int64_t next_event_ = 0;
  bool ever_failed_ = false;
  Status status_ = Status::ok;
  char error_[1280] = "";
  LcmLogCounters counters_;
};

}  // namespace stillmap
