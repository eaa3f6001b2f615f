#include "runtime/archive/map_saver.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr uint32_t kLengthBytes = sizeof(uint32_t);

/// Nobody waits for a save: whoever else wants the processor goes first, and it may allocate.
void step_back() {
  heap_guard::exempt_this_thread();
  constexpr int kNice = 10;
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
}

}  // namespace

MapSaver::MapSaver(std::string path, const Engine& engine)
    : path_(std::move(path)), engine_(engine), keys_(engine.group_capacity()) {
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
  return uint64_t{kPieces} * kMaxChunkBytes + groups * sizeof(uint64_t);
}

uint64_t MapSaver::memory_bytes() const {
  return pieces_.size() * pieces_[0].data.size() + keys_.size() * sizeof(uint64_t);
}

bool MapSaver::begin(const MapInfo& info) {
  if (saving_.load(std::memory_order_acquire)) return false;
  began_ = Clock::now();
  groups_ = std::min<uint64_t>(engine_.list_groups({keys_.data(), static_cast<uint32_t>(keys_.size())}),
                               keys_.size());
  next_group_ = next_place_ = 0;
  all_copied_ = false;
  failed_ = false;
  saving_ = true;
  Piece& piece = pieces_[filled_ % kPieces];
  piece.kind = ChunkKind::info;
  std::memcpy(piece.data.data(), &info, sizeof info);
  hand_over();
  return true;
}

SaveProgress MapSaver::progress() const {
  return {saving_.load(std::memory_order_acquire), groups_, next_group_};
}

bool MapSaver::step() {
  if (all_copied_) return false;
  if (filled_ - written_.load(std::memory_order_acquire) == kPieces) return false;
  Piece& piece = pieces_[filled_ % kPieces];
  piece.records = piece.bytes = 0;
  fill(piece);
  hand_over();
  return true;
}

void MapSaver::hand_over() {
  filled_.fetch_add(1, std::memory_order_release);
  ::sem_post(&work_);
}

void MapSaver::fill(Piece& piece) {
  if (failed_.load(std::memory_order_relaxed)) next_group_ = groups_;
  fill_groups(piece);
  if (piece.records > 0) return;
  fill_places(piece);
  if (piece.records > 0) return;
  piece.kind = ChunkKind::end;
  all_copied_ = true;
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
  const auto write = [&](View<uint8_t> record) { return engine_.write_group(keys_[next_group_], record); };
  while (next_group_ < groups_ && append(piece, write)) ++next_group_;
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

void MapSaver::write(const Piece& piece) {
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
  } else if (writer_ && !writer_->write(piece.kind, {piece.data.data(), piece.bytes}, piece.records)) {
    result_.error = writer_->error();
    writer_.reset();
  }
  failed_ = !writer_;
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
