#include "runtime/record/lcm_log_reader.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "runtime/record/lcm_log_format.hpp"

namespace stillmap {
namespace {

using lcm_log::Head;
using lcm_log::kHeadBytes;

constexpr size_t kReadBytes = 1 << 20;
constexpr size_t kSyncBytes = 4;

Error cannot_open(std::string message) {
  return {std::move(message), ErrorKind::cannot_open};
}

size_t bytes_of(const Head& head) {
  return size_t{kHeadBytes} + head.channel_bytes + head.payload_bytes;
}

bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < '\x7f'; });
}

}  // namespace

Result<LcmLogReader> LcmLogReader::open(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return cannot_open(path + ": cannot be read: " + std::generic_category().message(errno));
  LcmLogReader reader(path, file);
  struct stat about {};
  if (::fstat(file, &about) != 0 || !S_ISREG(about.st_mode))
    return cannot_open(path + ": expected an LCM event log, found a folder or a device");
  if (!reader.have(kSyncBytes) || !lcm_log::is_sync(reader.at(0)))
    return cannot_open(path + ": is no LCM event log (it does not begin with an event)");
  return reader;
}

LcmLogReader::LcmLogReader(std::string path, int file) : path_(std::move(path)), file_(file) {
  buffer_.resize(kReadBytes);
}

LcmLogReader::LcmLogReader(LcmLogReader&& other) noexcept {
  *this = std::move(other);
}

LcmLogReader& LcmLogReader::operator=(LcmLogReader&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(error_, other.error_);
  std::swap(file_, other.file_);
  std::swap(at_end_, other.at_end_);
  std::swap(buffer_, other.buffer_);
  std::swap(begin_, other.begin_);
  std::swap(end_, other.end_);
  std::swap(given_, other.given_);
  std::swap(damaged_, other.damaged_);
  std::swap(last_number_, other.last_number_);
  std::swap(counters_, other.counters_);
  return *this;
}

LcmLogReader::~LcmLogReader() {
  if (file_ >= 0) ::close(file_);
}

/// Reads on until so many bytes are held. @return false: the file ends before
bool LcmLogReader::have(size_t bytes) {
  if (held() >= bytes) return true;
  if (begin_ + bytes > buffer_.size()) {
    std::memmove(buffer_.data(), at(0), held());
    end_ -= std::exchange(begin_, 0);
    if (bytes > buffer_.size()) buffer_.resize(bytes + kReadBytes);  // at most the longest event
  }
  while (held() < bytes && !at_end_) {
    const ssize_t got = ::read(file_, buffer_.data() + end_, buffer_.size() - end_);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) error_ = path_ + ": cannot be read on: " + std::generic_category().message(errno);
    if (got <= 0) at_end_ = true;
    if (got > 0) end_ += static_cast<size_t>(got);
  }
  return held() >= bytes;
}

/// Where the next head that makes sense begins. @param from, end offsets, all held  @return end: nowhere
size_t LcmLogReader::next_head(size_t from, size_t end) const {
  for (; from + kHeadBytes <= end; ++from) {
    const void* const first = std::memchr(at(from), lcm_log::kSync >> 24, end - from);
    if (!first) return end;
    from = static_cast<size_t>(static_cast<const uint8_t*>(first) - at(0));
    Head head;
    if (from + kHeadBytes <= end && lcm_log::get_head(at(from), head)) return from;
  }
  return end;
}

/// Whether a whole event begins at `begin_`; its length can be damaged as well as anything else.
bool LcmLogReader::find_event(size_t& bytes) {
  Head head;
  if (!lcm_log::get_head(at(0), head)) return false;
  bytes = bytes_of(head);
  const bool whole = have(bytes);
  const bool ends_file = whole && !have(bytes + kSyncBytes);
  const bool followed = whole && !ends_file && lcm_log::is_sync(at(bytes));
  if (!followed && !ends_file) {
    have(bytes + kHeadBytes - 1);
    const size_t end = std::min(bytes + kHeadBytes - 1, held());
    if (next_head(kHeadBytes, end) < end) return false;  // another one begins before this one would end
  }
  if (!whole) return false;
  return is_printable({reinterpret_cast<const char*>(at(kHeadBytes)), head.channel_bytes});
}

/// @return false: there is none up to the end
bool LcmLogReader::skip_to_event() {
  if (!std::exchange(damaged_, true)) ++counters_.damaged_places;
  size_t next = next_head(1, held());
  while (next == held() && !at_end_) {
    // The last bytes may be the first of a head.
    const size_t passed = held() - std::min<size_t>(held(), kHeadBytes - 1);
    begin_ += passed;
    counters_.damaged_bytes += passed;
    have(kReadBytes / 2);
    next = next_head(0, held());
  }
  counters_.damaged_bytes += next;
  begin_ += next;
  return held() > 0;
}

bool LcmLogReader::next(LogEvent& event) {
  begin_ += std::exchange(given_, 0);
  size_t bytes = 0;
  while (true) {
    if (!have(kHeadBytes)) break;
    if (find_event(bytes)) break;
    bytes = 0;
    Head head;
    const bool cut_off =
        lcm_log::get_head(at(0), head) && !have(bytes_of(head)) && next_head(kHeadBytes, held()) == held();
    if (cut_off || !skip_to_event()) break;
  }
  if (bytes == 0) {
    counters_.cut_bytes += held();
    begin_ = end_;
    return false;
  }
  damaged_ = false;
  Head head;
  lcm_log::get_head(at(0), head);
  event.number = head.number;
  event.utime.us = head.utime_us;
  event.channel = {reinterpret_cast<const char*>(at(kHeadBytes)), head.channel_bytes};
  event.payload = {at(kHeadBytes + head.channel_bytes), head.payload_bytes};
  if (last_number_ >= 0 && head.number > last_number_ + 1)
    counters_.missing += static_cast<uint64_t>(head.number - last_number_ - 1);
  last_number_ = head.number;
  ++counters_.events;
  given_ = bytes;
  return true;
}

}  // namespace stillmap
