#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"
#include "kernels/base/view.hpp"
#include "runtime/ports/messages.hpp"

namespace stillmap {

/// One event of a log; name and payload are good until the next call.
struct LogEvent {
  int64_t number = 0;
  Utime utime;
  std::string_view channel;
  View<const uint8_t> payload;
};

/// What a reader met so far.
struct LogReadCounters {
  uint64_t events = 0;
  uint64_t missing = 0;        ///< by the events' numbers: dropped when written, or damaged
  uint64_t damaged_bytes = 0;  ///< passed over
  uint32_t damaged_places = 0;
  uint64_t cut_bytes = 0;  ///< of half an event at the end: the writer was killed, or is still at it
};

/// Reads an LCM event log, any program's. Where it is damaged, the reader goes on with the next event that
/// makes sense. A payload that was changed without changing its length is given out: whoever decodes it has
/// to see. Events are at most 64 MiB. @thread one; not the real-time thread
class LcmLogReader {
 public:
  /// @return kind cannot_open: not there, no file, no event at its beginning
  static Result<LcmLogReader> open(const std::string& path);

  LcmLogReader(LcmLogReader&& other) noexcept;
  LcmLogReader& operator=(LcmLogReader&& other) noexcept;
  ~LcmLogReader();

  /// @return false: the file has ended, or cannot be read on, see error()
  bool next(LogEvent& event);

  const LogReadCounters& counters() const { return counters_; }
  /// Empty unless the system could not read on.
  const std::string& error() const { return error_; }
  const std::string& path() const { return path_; }

 private:
  LcmLogReader(std::string path, int file);
  bool have(size_t bytes);
  bool find_event(size_t& bytes);
  bool skip_to_event();
  size_t next_head(size_t from, size_t end) const;
  const uint8_t* at(size_t offset) const { return buffer_.data() + begin_ + offset; }
  size_t held() const { return end_ - begin_; }

  std::string path_, error_;
  int file_ = -1;
  bool at_end_ = false;
  std::vector<uint8_t> buffer_;
  size_t begin_ = 0, end_ = 0;  ///< what of the buffer was read from the file and not yet given out
  size_t given_ = 0;            ///< bytes of the event that was given out last
  bool damaged_ = false;        ///< the place before `begin_`
  int64_t last_number_ = -1;
  LogReadCounters counters_;
};

}  // namespace stillmap
