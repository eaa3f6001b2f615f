#include "runtime/archive/block_archive.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <system_error>

#include "kernels/map/group_record.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kMostWantedPerFrame = 16;
constexpr uint32_t kPauseFrames = 100;  ///< after a write that failed
constexpr uint32_t kMostPutAwayPerFrame = 16;
constexpr float kRoomAhead = 0.05f;          ///< of the pool, for what is only near the view
constexpr uint32_t kFarAtOnce = 256;         ///< found by one walk over the table
constexpr uint32_t kEntriesLookedAt = 1024;  ///< for those to be erased, in one frame
constexpr size_t kMostFolderLetters = 400;
constexpr auto kWorkerWait = std::chrono::milliseconds(100);
constexpr auto kLongestAnswer = std::chrono::milliseconds(30000);  ///< of the disk, for one group

/// FNV-1a: a file that was cut or changed is seen.
uint64_t checksum(const uint8_t* bytes, uint32_t count) {
  uint64_t sum = 0xcbf29ce484222325ull;
  for (uint32_t i = 0; i < count; ++i) sum = (sum ^ bytes[i]) * 0x100000001b3ull;
  return sum;
}

/// Closed at the end of its scope.
class File {
 public:
  explicit File(int descriptor) : descriptor_(descriptor) {}
  ~File() {
    if (is_open()) ::close(descriptor_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  bool is_open() const { return descriptor_ >= 0; }
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

bool write_all(const File& file, const uint8_t* bytes, size_t count) {
  while (count > 0) {
    const ssize_t done = ::write(file.descriptor(), bytes, count);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    bytes += done;
    count -= static_cast<size_t>(done);
  }
  return true;
}

bool read_all(const File& file, uint8_t* bytes, size_t count) {
  while (count > 0) {
    const ssize_t done = ::read(file.descriptor(), bytes, count);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    bytes += done;
    count -= static_cast<size_t>(done);
  }
  return true;
}

/// @return false: cut, or not what was written
bool read_record(const File& file, uint8_t* record, uint32_t bytes) {
  uint64_t sum = 0;
  return read_all(file, record, bytes) && read_all(file, reinterpret_cast<uint8_t*>(&sum), sizeof sum) &&
         sum == checksum(record, bytes);
}

constexpr const char* kLockName = "lock";

/// @return the file that shows that somebody uses `folder`, held; -1: somebody else holds it, or it is not
/// there
int take_lock(const std::string& folder, int flags) {
  const int file = ::open((folder + "/" + kLockName).c_str(), O_RDWR | O_CLOEXEC | flags, 0644);
  if (file < 0 || ::flock(file, LOCK_EX | LOCK_NB) == 0) return file;
  ::close(file);
  return -1;
}

/// What runs left that ended without a chance to tidy up.
void remove_abandoned(const std::string& dir) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(dir, error)) {
    if (entry.path().filename().string().rfind("run-", 0) != 0) continue;
    const int lock = take_lock(entry.path().string(), 0);
    if (lock < 0) continue;
    fs::remove_all(entry.path(), error);
    ::close(lock);
  }
}

/// A folder that no other run uses.
std::string folder_below(const std::string& dir) {
  return (fs::path(dir) / fmt::format("run-{}", ::getpid())).string();
}

}  // namespace

uint64_t BlockArchive::planned_bytes(const Options& options) {
  return uint64_t{options.slots} * (kMaxGroupRecordBytes + sizeof(Slot)) +
         uint64_t{options.max_groups} * (sizeof(Entry) + sizeof(uint32_t));
}

Result<std::unique_ptr<BlockArchive>> BlockArchive::open(const Options& options) {
  const std::string folder = folder_below(options.dir);
  if (folder.size() > kMostFolderLetters)
    return Error{fmt::format("archive.dir: {} is longer than {} letters", folder, kMostFolderLetters)};
  std::error_code error;
  fs::remove_all(folder, error);  // of a dead process with our number
  fs::create_directories(folder, error);
  if (error)
    return Error{fmt::format("archive.dir: {} cannot be made: {}; name a folder that can be written, or none",
                             folder, error.message())};
  const int lock = take_lock(folder, O_CREAT);
  if (lock < 0) return Error{fmt::format("archive.dir: {}/{} cannot be written", folder, kLockName)};
  remove_abandoned(options.dir);
  return std::unique_ptr<BlockArchive>(new BlockArchive(options, folder, lock));
}

BlockArchive::BlockArchive(const Options& options, std::string folder, int lock)
    : options_(options),
      folder_(std::move(folder)),
      lock_(lock),
      entries_(options.max_groups),
      free_entries_(options.max_groups),
      slots_(options.slots),
      free_slots_(options.slots),
      far_(kFarAtOnce),
      wanted_(kMostWantedPerFrame),
      orders_(options.slots),
      answers_(options.slots) {
  std::iota(free_entries_.rbegin(), free_entries_.rend(), 0u);
  std::iota(free_slots_.rbegin(), free_slots_.rend(), 0u);
  for (Slot& slot : slots_) slot.record.resize(kMaxGroupRecordBytes);
  worker_ = std::thread([this] { work(); });
}

BlockArchive::~BlockArchive() {
  stopping_ = true;
  worker_.join();
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
  ::close(lock_);
}

// --- the loop

uint32_t BlockArchive::step(Engine& engine, Vec3 centre_map) {
  uint32_t taken = 0;
  for (uint32_t number = 0; answers_.pop(number); ++taken) take_answer(engine, number);
  order(engine, centre_map);
  return taken;
}

bool BlockArchive::repeat_step(Engine& engine, Vec3 centre_map, uint32_t answers) {
  for (uint32_t taken = 0, number = 0; taken < answers; ++taken) {
    if (!answers_.pop_within(number, kLongestAnswer)) return false;
    take_answer(engine, number);
  }
  order(engine, centre_map);
  return true;
}

void BlockArchive::order(Engine& engine, Vec3 centre_map) {
  erase_doomed();
  fetch_wanted(engine);
  put_away_far(engine, centre_map);
}

void BlockArchive::forget() {
  ++map_;
  far_left_ = 0;
  for (Entry& entry : entries_) {
    if (entry.state != EntryState::stored) continue;  // what is on its way is doomed when it arrives
    entry.state = EntryState::doomed;
    ++doomed_;
  }
}

void BlockArchive::erase_doomed() {
  for (uint32_t n = 0; doomed_ > 0 && n < kEntriesLookedAt; ++n) {
    const uint32_t number = doomed_from_++ % options_.max_groups;
    if (entries_[number].state != EntryState::doomed) continue;
    if (!send(Order::erase, number)) return;
    release(number);
    --doomed_;
  }
}

void BlockArchive::take_answer(Engine& engine, uint32_t number) {
  Slot& slot = slots_[number];
  if (slot.order != Order::erase && slot.map != map_) {
    entries_[slot.entry].state = EntryState::doomed;
    ++doomed_;
    free_slots_.push_back(number);
    return;
  }
  if (slot.order == Order::store) stored(engine, slot);
  const bool used_up = slot.order == Order::load && loaded(engine, slot);
  if (used_up) {
    // Before a later order for the same group: orders are done in turn.
    slot.order = Order::erase;
    if (orders_.push(number)) return;
  }
  free_slots_.push_back(number);
}

void BlockArchive::stored(Engine& engine, const Slot& slot) {
  if (slot.done) {
    ++counters_.stored;
    entries_[slot.entry].state = EntryState::stored;
    return;
  }
  // The record is still here: back into the map with it, and no further try for a while.
  ++counters_.failed;
  if (engine.read_group({slot.record.data(), slot.bytes}) != Status::ok) engine.forget_group(slot.key);
  release(slot.entry);
  pause_ = kPauseFrames;
  far_left_ = 0;
}

/// @return true: its file is of no more use
bool BlockArchive::loaded(Engine& engine, const Slot& slot) {
  Status status = Status::unavailable;
  if (slot.done)
    status = engine.map_health().fill > options_.full ? Status::capacity_exhausted
                                                      : engine.read_group({slot.record.data(), slot.bytes});
  if (status == Status::capacity_exhausted) {
    ++counters_.no_room;
    entries_[slot.entry].state = EntryState::stored;
    return false;
  }
  if (status == Status::ok) {
    ++counters_.restored;
  } else {
    ++counters_.failed;
    engine.forget_group(slot.key);
  }
  release(slot.entry);
  return true;
}

void BlockArchive::release(uint32_t entry) {
  counters_.bytes -= entries_[entry].bytes;
  --counters_.groups;
  entries_[entry] = {};
  free_entries_.push_back(entry);
}

/// @return false: all slots are on their way
bool BlockArchive::send(Order order, uint32_t entry) {
  if (free_slots_.empty()) return false;
  const uint32_t number = free_slots_.back();
  Slot& slot = slots_[number];
  slot.order = order;
  slot.key = entries_[entry].key;
  slot.map = entries_[entry].map;
  slot.entry = entry;
  slot.bytes = entries_[entry].bytes;
  if (!orders_.push(number)) return false;
  free_slots_.pop_back();
  return true;
}

void BlockArchive::fetch_wanted(Engine& engine) {
  const uint32_t count = engine.wanted_groups({wanted_.data(), kMostWantedPerFrame});
  const bool room_ahead = engine.map_health().fill < options_.keep_below - kRoomAhead;
  for (uint32_t i = 0; i < count; ++i) {
    if (!wanted_[i].in_view && !room_ahead) continue;
    Entry& entry = entries_[wanted_[i].entry];
    const bool is_here = entry.state == EntryState::stored && entry.key == wanted_[i].key;
    if (is_here && send(Order::load, wanted_[i].entry)) entry.state = EntryState::loading;
  }
}

void BlockArchive::put_away_far(Engine& engine, Vec3 centre_map) {
  if (engine.map_health().fill <= options_.keep_below) {
    far_left_ = 0;
    return;
  }
  if (pause_ > 0) {
    --pause_;
    return;
  }
  if (far_left_ == 0) {
    far_left_ = engine.farthest_groups(centre_map, {far_.data(), kFarAtOnce}, false);
    near_view_ = far_left_ == 0;
    if (near_view_) far_left_ = engine.farthest_groups(centre_map, {far_.data(), kFarAtOnce}, true);
    std::reverse(far_.begin(), far_.begin() + far_left_);
  }
  for (uint32_t n = 0; n < kMostPutAwayPerFrame && far_left_ > 0; ++n)
    if (put_away(engine, far_[far_left_ - 1])) --far_left_;
  if (near_view_) far_left_ = 0;  // the next frame may see them
}

/// @return false: not now, all slots are on their way
bool BlockArchive::put_away(Engine& engine, uint64_t key) {
  if (free_slots_.empty()) return false;
  std::vector<uint8_t>& record = slots_[free_slots_.back()].record;
  const uint32_t bytes = engine.write_group(key, {record.data(), kMaxGroupRecordBytes});
  if (bytes == 0) return true;  // gone meanwhile
  if (free_entries_.empty() || counters_.bytes + bytes > options_.max_bytes) {
    // The farthest is what is worth least; the map itself drops it when it has to.
    ++counters_.refused;
    return true;
  }
  const uint32_t entry = free_entries_.back();
  entries_[entry] = {key, bytes, map_, EntryState::storing};
  if (!send(Order::store, entry)) {
    entries_[entry] = {};
    return false;
  }
  free_entries_.pop_back();
  counters_.bytes += bytes;
  ++counters_.groups;
  engine.put_away(key, entry);
  return true;
}

// --- the background thread

void BlockArchive::work() {
  // What was ordered is done before the end: a group on its way is in no other place.
  while (true) {
    uint32_t number = 0;
    if (!orders_.pop_within(number, kWorkerWait)) {
      if (stopping_) return;
      continue;
    }
    Slot& slot = slots_[number];
    slot.done = slot.order == Order::store  ? write(slot)
                : slot.order == Order::load ? read(slot)
                                            : erase(slot);
    answers_.push(number);  // as long as there are slots
  }
}

// Plain system calls and no text but on the stack: this thread may not allocate either.

void BlockArchive::path(uint32_t map, uint64_t key, Path& out) const {
  std::snprintf(out.text, sizeof out.text, "%s/%" PRIu32 "-%016" PRIx64 ".group", folder_.c_str(), map, key);
}

bool BlockArchive::write(const Slot& slot) {
  Path name;
  path(slot.map, slot.key, name);
  const uint64_t sum = checksum(slot.record.data(), slot.bytes);
  const File file(::open(name.text, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (file.is_open() && write_all(file, slot.record.data(), slot.bytes) &&
      write_all(file, reinterpret_cast<const uint8_t*>(&sum), sizeof sum))
    return true;
  note_error(name, "cannot be written; free space on the disk, or lower archive.max_bytes", errno);
  ::unlink(name.text);
  return false;
}

bool BlockArchive::read(Slot& slot) {
  Path name;
  path(slot.map, slot.key, name);
  const File file(::open(name.text, O_RDONLY | O_CLOEXEC));
  errno = 0;
  if (file.is_open() && read_record(file, slot.record.data(), slot.bytes)) return true;
  note_error(name, "is gone or not what was written; this part of the map is lost", errno);
  return false;
}

bool BlockArchive::erase(const Slot& slot) {
  Path name;
  path(slot.map, slot.key, name);
  return ::unlink(name.text) == 0;
}

void BlockArchive::note_error(const Path& name, const char* what, int error) {
  const std::lock_guard lock(error_mutex_);
  std::snprintf(error_, sizeof error_, "%s: %s%s%s", name.text, what, error ? ": " : "",
                error ? strerrordesc_np(error) : "");
}

std::string BlockArchive::last_error() const {
  const std::lock_guard lock(error_mutex_);
  return error_;
}

uint32_t BlockArchive::list(View<uint64_t> keys) const {
  uint32_t count = 0;
  for (const Entry& entry : entries_)
    if (count < keys.size && (entry.state == EntryState::stored || entry.state == EntryState::loading))
      keys[count++] = entry.key;
  return count;
}

uint32_t BlockArchive::copy(uint64_t key, View<uint8_t> record) const {
  Path name;
  path(map_, key, name);
  const File file(::open(name.text, O_RDONLY | O_CLOEXEC));
  struct stat about = {};
  if (!file.is_open() || ::fstat(file.descriptor(), &about) != 0) return 0;
  const int64_t bytes = about.st_size - static_cast<int64_t>(sizeof(uint64_t));
  if (bytes <= 0 || bytes > static_cast<int64_t>(record.size)) return 0;
  const auto count = static_cast<uint32_t>(bytes);
  return read_record(file, record.data, count) ? count : 0;
}

std::string BlockArchive::make_room(Engine& engine, Vec3 centre_map) {
  for (uint64_t before = ~uint64_t{0}; engine.map_health().fill > options_.keep_below;) {
    if (counters_.stored == before) return {};
    before = counters_.stored;
    far_left_ = 0;  // the map has grown since
    put_away_far(engine, centre_map);
    if (std::string error = settle(engine); !error.empty()) return error;
  }
  return {};
}

/// Waits until what is on its way has arrived.
std::string BlockArchive::settle(Engine& engine) {
  uint32_t number = 0;
  while (free_slots_.size() < slots_.size()) {
    if (!answers_.pop_within(number, kLongestAnswer))
      return fmt::format("{}: the disk did not answer within {} s", folder_, kLongestAnswer.count() / 1000);
    take_answer(engine, number);
  }
  return {};
}

std::string BlockArchive::for_each(Engine& engine, const std::function<bool(View<const uint8_t> record)>& f) {
  if (std::string error = settle(engine); !error.empty()) return error;
  Slot slot;
  slot.record.resize(kMaxGroupRecordBytes);
  for (const Entry& entry : entries_) {
    if (entry.state != EntryState::stored) continue;
    slot.key = entry.key;
    slot.map = entry.map;
    slot.bytes = entry.bytes;
    if (!read(slot)) return last_error();
    if (!f({slot.record.data(), slot.bytes})) break;
  }
  return {};
}

}  // namespace stillmap
