#pragma once

#include <semaphore.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "kernels/engine.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_file.hpp"

namespace stillmap {

/// How far a save is. A group counts as done once it is copied; the file is in place when `saving` ends.
struct SaveProgress {
  bool saving = false;
  uint64_t groups = 0;  ///< of the map when the save began
  uint64_t groups_done = 0;
};

/// How a save ended.
struct SaveResult {
  std::string error;   ///< one line with file and reason; empty: the file is in place
  uint64_t bytes = 0;  ///< of the file
  double seconds = 0;  ///< from `begin` to the file in place
};

/// Saves the map to a file while it is being worked on. The loop copies a bounded piece in each `step`; a
/// thread packs and writes it. Pieces go through a ring of a few; while it is full a step copies nothing. A
/// group that changes during the save is saved as it was before or after; one that comes up during it is left
/// for the next. Groups in the archive are read there by the thread. Groups move between the map and the
/// archive meanwhile: what was not found in one is looked for in the other.
/// @thread begin, step, progress, result: the engine's caller; none of the first three allocates, locks or
/// waits.
class MapSaver {
 public:
  /// Takes all the memory (planned_bytes) and starts the thread. @param engine, archive (may be null)
  /// outlive this
  MapSaver(std::string path, const Engine& engine, const BlockArchive* archive = nullptr);
  /// A save that is not finished is given up; the file that was there stays.
  ~MapSaver();
  MapSaver(const MapSaver&) = delete;
  MapSaver& operator=(const MapSaver&) = delete;

  /// Lists what there is to save. @return false: a save is going on
  bool begin(const MapInfo& info);
  /// Copies the next piece. @return false: there was nothing to do, or no room for it
  bool step();

  SaveProgress progress() const;
  /// Of the last save that ended. Not while one is going on.
  const SaveResult& result() const { return result_; }
  const std::string& path() const { return path_; }
  uint64_t memory_bytes() const;
  /// For the plan. @param groups Engine::group_capacity
  static uint64_t planned_bytes(uint32_t groups);

 private:
  /// On their way to the thread.
  static constexpr uint32_t kPieces = 4;
  /// Looks at the map and at the archive in turn for what was not found; then it is gone.
  static constexpr uint32_t kMostRounds = 8;
  /// A piece on its way. Owned by the loop, and by the thread between `filled_` and `written_`.
  struct Piece {
    ChunkKind kind = ChunkKind::info;
    bool archived = false;  ///< keys of groups in the archive; the thread leaves those that are not there
    uint32_t records = 0;
    uint32_t bytes = 0;
    std::vector<uint8_t> data;
  };
  using Clock = std::chrono::steady_clock;

  template <class Write>
  bool append(Piece& piece, Write&& write);
  bool fill(Piece& piece);
  bool start_round();
  void fill_groups(Piece& piece);
  void fill_archived(Piece& piece);
  void fill_places(Piece& piece);
  void hand_over();
  void take_back();

  void write_pieces();
  void write(Piece& piece);
  bool write_archived(Piece& piece);
  void finish();

  const std::string path_;
  const Engine& engine_;
  const BlockArchive* const archive_;
  std::array<Piece, kPieces> pieces_;
  std::atomic<uint64_t> filled_ = 0, written_ = 0;  ///< pieces, ever
  std::atomic<bool> saving_ = false, failed_ = false, stop_ = false;
  sem_t work_;

  // The loop's.
  std::vector<uint64_t> keys_;  ///< of this round; those behind `next_group_` make room for the next round's
  uint64_t groups_ = 0, next_group_ = 0, kept_ = 0, total_ = 0;
  uint32_t rounds_ = 0;
  uint64_t taken_back_ = 0;  ///< pieces, ever
  uint32_t next_place_ = 0;
  bool all_copied_ = true;
  Clock::time_point began_;

  // The thread's, and the loop's while nothing is being saved.
  std::optional<MapFileWriter> writer_;
  std::vector<uint8_t> record_;  ///< from the archive
  SaveResult result_;

  std::thread thread_;
};

}  // namespace stillmap
