#include "runtime/record/lcm_log_writer.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <optional>
#include <system_error>
#include <utility>

#include "runtime/record/lcm_log_files.hpp"
#include "runtime/record/lcm_log_format.hpp"

namespace stillmap {
namespace {

/// A limit on the size of a file (RLIMIT_FSIZE) or on a user's share of the disk is a full disk, too.
Status status_of(int error) {
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  return full ? Status::capacity_exhausted : Status::unavailable;
}

int64_t ns_of(double seconds) {
  return static_cast<int64_t>(seconds * 1e9);
}

uint64_t event_bytes(size_t channel, size_t payload) {
  return lcm_log::kHeadBytes + channel + payload;
}

}  // namespace

LcmLogWriter::LcmLogWriter(const LcmLogOptions& options, LogDisk& disk)
    : options_(options), disk_(disk), closed_(kMaxFiles) {}

LcmLogWriter::~LcmLogWriter() {
  close();
}

Result<std::unique_ptr<LcmLogWriter>> LcmLogWriter::open(const LcmLogOptions& options, LogDisk& disk) {
  if (options.dir.size() + options.name.size() + 64 > sizeof(Path))
    return Error{options.dir + ": the name of the log's folder is too long"};
  if (options.max_bytes < 2 * options.file_bytes)
    return Error{"record.log_max_bytes must be at least twice record.log_file_bytes", ErrorKind::bad_usage};
  std::unique_ptr<LcmLogWriter> writer(new LcmLogWriter(options, disk));
  if (std::string error = writer->take_over(); !error.empty()) return Error{std::move(error)};
  return writer;
}

/// What earlier runs left counts, and the first of it is deleted first.
std::string LcmLogWriter::take_over() {
  std::vector<LogDisk::Entry> entries;
  if (const int error = disk_.list(options_.dir, entries); error != 0)
    return options_.dir + ": cannot be used for the event log: " + std::generic_category().message(error);
  std::vector<ClosedFile> found;
  for (const LogDisk::Entry& entry : entries) {
    const auto name = parse_log_file_name(options_.name, entry.name);
    if (!name) continue;
    found.push_back({name->number, entry.bytes, disk_.now_ns()});
    if (!name->part) continue;
    ++counters_.taken_over;
    const int error = disk_.rename(path(name->number, true).text, path(name->number, false).text);
    if (error != 0)
      return options_.dir + "/" + entry.name +
             ": an earlier run's log cannot be renamed: " + std::generic_category().message(error);
  }
  std::sort(found.begin(), found.end(),
            [](const ClosedFile& a, const ClosedFile& b) { return a.number < b.number; });
  if (!found.empty()) number_ = found.back().number;
  for (const ClosedFile& file : found) {
    if (closed_count_ == kMaxFiles)
      if (const int error = delete_oldest(); error != 0)
        return options_.dir + ": holds more than " + std::to_string(kMaxFiles) +
               " files of earlier logs, and the first cannot be deleted: " +
               std::generic_category().message(error);
    closed_[(closed_first_ + closed_count_++) % kMaxFiles] = file;
    closed_bytes_ += file.bytes;
  }
  counters_.bytes = closed_bytes_;
  return {};
}

void LcmLogWriter::begin_files_with(const std::string& channel, Utime utime, View<const uint8_t> payload) {
  first_channel_ = channel;
  first_utime_ = utime;
  first_payload_.assign(payload.begin(), payload.end());
}

Status LcmLogWriter::write(const char* channel, Utime utime, View<const uint8_t> payload) {
  const size_t channel_bytes = std::strlen(channel);
  const uint64_t bytes = event_bytes(channel_bytes, payload.size);
  const uint64_t first =
      first_channel_.empty() ? 0 : event_bytes(first_channel_.size(), first_payload_.size());
  const bool fits = channel_bytes >= 1 && channel_bytes <= lcm_log::kMaxChannel &&
                    payload.size <= lcm_log::kMaxPayload && first + bytes <= options_.file_bytes;
  const bool wait = status_ != Status::ok && disk_.now_ns() < retry_ns_;
  Status result = fits ? status_ : Status::out_of_range;
  if (fits && !wait) {
    result = Status::ok;
    if (file_ >= 0 && file_is_done(bytes)) end_file();
    if (file_ < 0) result = begin_file();
    if (result == Status::ok) result = put(channel, utime.us, payload);
    if (result == Status::ok) status_ = Status::ok;
  }
  if (result != Status::ok) {
    ++counters_.dropped;
    ++next_event_;
  }
  return result;
}

bool LcmLogWriter::file_is_done(uint64_t bytes) const {
  return file_bytes_ + bytes > options_.file_bytes || disk_.now_ns() - begun_ns_ > ns_of(options_.file_s);
}

/// Appends one event to the open file.
Status LcmLogWriter::put(const char* channel, int64_t utime_us, View<const uint8_t> payload) {
  const size_t channel_bytes = std::strlen(channel);
  uint8_t head[lcm_log::kHeadBytes];
  lcm_log::put_head({next_event_, utime_us, static_cast<uint32_t>(channel_bytes), payload.size}, head);
  // The system only reads from them.
  iovec pieces[] = {{head, sizeof head},
                    {const_cast<char*>(channel), channel_bytes},
                    {const_cast<uint8_t*>(payload.data), payload.size}};
  if (const int error = disk_.append(file_, {pieces, 3}); error != 0) {
    disk_.cut(file_, file_bytes_);  // half an event; cutting needs no room
    return stop("cannot be written", number_, error);
  }
  ++next_event_;
  ++counters_.events;
  file_bytes_ += event_bytes(channel_bytes, payload.size);
  counters_.bytes = closed_bytes_ + file_bytes_;
  return Status::ok;
}

Status LcmLogWriter::begin_file() {
  if (const Status status = make_room(); status != Status::ok) return status;
  const int file = disk_.create(path(number_ + 1, true).text);
  if (file < 0) return stop("cannot be made", number_ + 1, -file);
  ++number_;
  ++counters_.files_begun;
  file_ = file;
  file_bytes_ = synced_bytes_ = 0;
  begun_ns_ = disk_.now_ns();
  sync_due_ns_ = begun_ns_ + ns_of(options_.sync_s);
  // Else a power cut may lose the whole file.
  if (const int error = disk_.sync_folder(options_.dir.c_str()); error != 0)
    stop("cannot be made safe against a power cut", number_, error);
  if (first_channel_.empty()) return Status::ok;
  const Status status = put(first_channel_.c_str(), first_utime_.us,
                            {first_payload_.data(), static_cast<uint32_t>(first_payload_.size())});
  if (status != Status::ok) {  // a file has to begin with it
    disk_.close(std::exchange(file_, -1));
    disk_.remove(path(number_--, true).text);
    --counters_.files_begun;
    file_bytes_ = 0;
  }
  return status;
}

/// Room for one more file within the bytes, and nothing that is too old.
Status LcmLogWriter::make_room() {
  const int64_t now_ns = disk_.now_ns();
  const auto too_old = [&](const ClosedFile& file) {
    return options_.max_s > 0 && now_ns - file.closed_ns > ns_of(options_.max_s);
  };
  while (closed_count_ > 0 && (closed_bytes_ + options_.file_bytes > options_.max_bytes ||
                               closed_count_ + 1 > kMaxFiles || too_old(closed_[closed_first_]))) {
    const uint32_t number = closed_[closed_first_].number;
    if (const int error = delete_oldest(); error != 0)
      return stop("cannot be deleted to make room", number, error);
  }
  return Status::ok;
}

int LcmLogWriter::delete_oldest() {
  const int error = disk_.remove(path(closed_[closed_first_].number, false).text);
  if (error != 0 && error != ENOENT) return error;
  closed_bytes_ -= closed_[closed_first_].bytes;
  closed_first_ = (closed_first_ + 1) % kMaxFiles;
  --closed_count_;
  ++counters_.files_deleted;
  counters_.bytes = closed_bytes_ + file_bytes_;
  return 0;
}

void LcmLogWriter::end_file() {
  if (file_ < 0) return;
  if (const int error = disk_.sync(file_); error != 0) stop("cannot be synced", number_, error);
  if (const int error = disk_.close(std::exchange(file_, -1)); error != 0)
    stop("cannot be closed", number_, error);
  if (const int error = disk_.rename(path(number_, true).text, path(number_, false).text); error != 0)
    stop("cannot be renamed", number_, error);
  closed_[(closed_first_ + closed_count_++) % kMaxFiles] = {number_, file_bytes_, disk_.now_ns()};
  closed_bytes_ += file_bytes_;
  file_bytes_ = synced_bytes_ = 0;
}

Status LcmLogWriter::step() {
  if (file_ < 0 || synced_bytes_ == file_bytes_ || disk_.now_ns() < sync_due_ns_) return status_;
  if (const int error = disk_.sync(file_); error != 0) {
    // What of it is on the disk nobody knows; the system will not try again. The next event begins a new
    // file.
    stop("cannot be synced", number_, error);
    end_file();
    return status_;
  }
  synced_bytes_ = file_bytes_;
  sync_due_ns_ = disk_.now_ns() + ns_of(options_.sync_s);
  return status_;
}

void LcmLogWriter::rotate() {
  end_file();
}

bool LcmLogWriter::close() {
  end_file();
  return !ever_failed_;
}

/// Notes a failure; writing is tried again after a while.
Status LcmLogWriter::stop(const char* what, uint32_t file, int error) {
  if (status_ == Status::ok) ++counters_.stops;
  ever_failed_ = true;
  status_ = status_of(error);
  retry_ns_ = disk_.now_ns() + kRetryNs;
  const char* const advice =
      status_ == Status::capacity_exhausted ? "; free space on the disk, or lower record.log_max_bytes" : "";
  std::snprintf(error_, sizeof error_, "%s: %s: %s%s", path(file, file == number_ && file_ >= 0).text, what,
                strerrordesc_np(error), advice);
  return status_;
}

LcmLogWriter::Path LcmLogWriter::path(uint32_t number, bool open) const {
  Path path;
  std::snprintf(path.text, sizeof path.text, "%s/%s-%06" PRIu32 ".lcm%s", options_.dir.c_str(),
                options_.name.c_str(), number, open ? ".part" : "");
  return path;
}

}  // namespace stillmap
