#include "runtime/archive/map_saver.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

namespace stillmap {
namespace {

constexpr uint32_t kLengthBytes = sizeof(uint32_t);
constexpr uint32_t kLooksAtOnce = 4096;  ///< for groups in the map, in one step
constexpr uint32_t kKeysAtOnce = 64;     ///< that the thread reads from the archive as one piece

/// Nobody waits for a save: whoever else wants the processor goes first, and it may allocate.
void step_back() {
  constexpr int kNice = 10;
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
}

}  // namespace

MapSaver::MapSaver(std::string path, const Engine& engine, const BlockArchive* archive)
    : path_(std::move(path)),
      engine_(engine),
      archive_(archive),
      keys_(engine.group_capacity()),
      record_(kLengthBytes + kMaxRecordBytes) {
  ::sem_init(&work_, 0, 0);
  for (Piece& piece : pieces_) piece.data.resize(kMaxChunkBytes);
  thread_ = std::thread([this] { write_pieces(); });
}

MapSaver::~MapSaver() {
  stop_ = true;
  ::sem_post(&work_);
  thread_.join();
  ::sem_destroy(&work_);
}

uint64_t MapSaver::planned_bytes(uint32_t groups) {
  return uint64_t{kPieces} * kMaxChunkBytes + groups * sizeof(uint64_t) + kLengthBytes + kMaxRecordBytes;
}

uint64_t MapSaver::memory_bytes() const {
  return pieces_.size() * pieces_[0].data.size() + keys_.size() * sizeof(uint64_t) + record_.size();
}

bool MapSaver::begin(const MapInfo& info) {
  if (saving_.load(std::memory_order_acquire)) return false;
  began_ = Clock::now();
  const auto size = static_cast<uint32_t>(keys_.size());
  uint32_t listed = std::min(engine_.list_groups({keys_.data(), size}), size);
  if (archive_) listed += archive_->list({keys_.data() + listed, size - listed});
  total_ = groups_ = listed;
  next_group_ = kept_ = next_place_ = rounds_ = 0;
  all_copied_ = false;
  failed_ = false;
  saving_ = true;
  Piece& piece = pieces_[filled_ % kPieces];
  piece.kind = ChunkKind::info;
  piece.archived = false;
  std::memcpy(piece.data.data(), &info, sizeof info);
  hand_over();
  return true;
}

SaveProgress MapSaver::progress() const {
  return {saving_.load(std::memory_order_acquire), total_, total_ - kept_ - (groups_ - next_group_)};
}

bool MapSaver::step() {
  if (all_copied_) return false;
  take_back();
  if (filled_ - taken_back_ == kPieces || !start_round()) return false;
  Piece& piece = pieces_[filled_ % kPieces];
  piece.records = piece.bytes = 0;
  piece.archived = false;
  if (!fill(piece)) return false;
  hand_over();
  return true;
}

void MapSaver::hand_over() {
  filled_.fetch_add(1, std::memory_order_release);
  ::sem_post(&work_);
}

/// What was written; what the archive did not have is kept for the next round.
void MapSaver::take_back() {
  for (const uint64_t written = written_.load(std::memory_order_acquire); taken_back_ < written;
       ++taken_back_) {
    const Piece& piece = pieces_[taken_back_ % kPieces];
    if (!piece.archived) continue;
    std::memcpy(keys_.data() + kept_, piece.data.data(), piece.records * sizeof(uint64_t));
    kept_ += piece.records;
  }
}

/// Goes on with what was not found, when all of this round is through.
/// @return false: the thread is not there yet
bool MapSaver::start_round() {
  if (next_group_ < groups_ || !archive_ || groups_ == 0) return true;
  if (taken_back_ < filled_) return false;
  const bool again = ++rounds_ < kMostRounds;
  groups_ = again ? kept_ : 0;
  next_group_ = kept_ = 0;
  return true;
}

/// @return false: nothing to hand over yet
bool MapSaver::fill(Piece& piece) {
  if (failed_.load(std::memory_order_relaxed)) groups_ = next_group_ = kept_ = 0;
  if (next_group_ < groups_) rounds_ % 2 == 0 ? fill_groups(piece) : fill_archived(piece);
  if (piece.records > 0) return true;
  if (next_group_ < groups_ || kept_ > 0) return false;
  fill_places(piece);
  if (piece.records > 0) return true;
  piece.kind = ChunkKind::end;
  all_copied_ = true;
  return true;
}

/// @param write puts a record into a view and answers its length. @return false when the piece is full
template <class Write>
bool MapSaver::append(Piece& piece, Write&& write) {
  if (piece.bytes >= kChunkBytes) return false;
  uint8_t* const at = piece.data.data() + piece.bytes;
  const uint32_t length = write(View<uint8_t>{at + kLengthBytes, kMaxRecordBytes});
  if (length == 0) return true;  // it is gone
  std::memcpy(at, &length, kLengthBytes);
  piece.bytes += kLengthBytes + length;
  ++piece.records;
  return true;
}

void MapSaver::fill_groups(Piece& piece) {
  piece.kind = ChunkKind::groups;
  const auto write = [&](View<uint8_t> record) {
    const uint32_t bytes = engine_.write_group(keys_[next_group_], record);
    if (bytes == 0 && archive_) keys_[kept_++] = keys_[next_group_];
    return bytes;
  };
  for (uint32_t looks = 0; looks < kLooksAtOnce && next_group_ < groups_ && append(piece, write); ++looks)
    ++next_group_;
}

void MapSaver::fill_archived(Piece& piece) {
  piece.kind = ChunkKind::groups;
  piece.archived = true;
  piece.records = static_cast<uint32_t>(std::min<uint64_t>(groups_ - next_group_, kKeysAtOnce));
  std::memcpy(piece.data.data(), keys_.data() + next_group_, piece.records * sizeof(uint64_t));
  next_group_ += piece.records;
}

void MapSaver::fill_places(Piece& piece) {
  piece.kind = ChunkKind::places;
  const auto write = [&](View<uint8_t> record) { return engine_.write_place(next_place_, record); };
  while (next_place_ < engine_.place_count() && append(piece, write)) ++next_place_;
}

/// The thread: writes piece after piece until the end.
void MapSaver::write_pieces() {
  step_back();
  while (true) {
    while (::sem_wait(&work_) != 0 && errno == EINTR) {
    }
    if (stop_) return;
    write(pieces_[written_ % kPieces]);
    written_.fetch_add(1, std::memory_order_release);
  }
}

void MapSaver::write(Piece& piece) {
  if (piece.kind == ChunkKind::info) {
    MapInfo info;
    std::memcpy(&info, piece.data.data(), sizeof info);
    auto writer = MapFileWriter::create(path_, info);
    result_ = {};
    if (writer)
      writer_.emplace(std::move(*writer));
    else
      result_.error = writer.error();
  } else if (piece.kind == ChunkKind::end) {
    return finish();
  } else if (writer_ && !(piece.archived ? write_archived(piece)
                                         : writer_->write(piece.kind, {piece.data.data(), piece.bytes},
                                                          piece.records))) {
    result_.error = writer_->error();
    writer_.reset();
  }
  failed_ = !writer_;
}

bool MapSaver::write_archived(Piece& piece) {
  uint32_t missing = 0;
  for (uint32_t i = 0; i < piece.records; ++i) {
    uint64_t key = 0;
    std::memcpy(&key, piece.data.data() + i * sizeof key, sizeof key);
    const uint32_t bytes = archive_->copy(key, {record_.data() + kLengthBytes, kMaxGroupRecordBytes});
    if (bytes == 0) {
      std::memcpy(piece.data.data() + missing++ * sizeof key, &key, sizeof key);
      continue;
    }
    std::memcpy(record_.data(), &bytes, kLengthBytes);
    if (!writer_->write(ChunkKind::groups, {record_.data(), kLengthBytes + bytes}, 1)) return false;
  }
  piece.records = missing;
  return true;
}

void MapSaver::finish() {
  if (writer_) {
    if (!writer_->close()) result_.error = writer_->error();
    result_.bytes = writer_->bytes();
    writer_.reset();
  }
  result_.seconds = std::chrono::duration<double>(Clock::now() - began_).count();
  saving_.store(false, std::memory_order_release);
}

}  // namespace stillmap
