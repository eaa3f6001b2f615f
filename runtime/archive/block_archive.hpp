#pragma once

// Where groups of blocks wait, on disk, until the robot comes back.

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "config/result.hpp"
#include "kernels/engine.hpp"
#include "runtime/core/bounded_queue.hpp"

namespace stillmap {

/// Since it was opened.
struct ArchiveCounters {
  uint64_t stored = 0, restored = 0;
  uint64_t refused = 0;  ///< archive full: by bytes, or by groups; what was to be stored is given up
  uint64_t failed = 0;   ///< could not be written or read; given up
  uint64_t no_room = 0;  ///< restored while the map had no room; tried again while it is wanted
  uint64_t bytes = 0;    ///< on disk now
  uint32_t groups = 0;   ///< on disk, or on their way
};

/// Keeps the fullest pool of a map below `keep_below`: what is farthest goes first, and comes back when it
/// comes into view. One file a group in a folder of its own below `dir`, which is gone with the archive, or,
/// after a crash, with the next one that is opened in `dir`.
///
/// The loop calls `step` once a frame; it copies at most a few groups to or from slots of memory taken at
/// boot, and neither waits nor touches files. A background thread does.
class BlockArchive {
 public:
  struct Options {
    std::string dir;         ///< made when it is not there
    uint64_t max_bytes = 0;  ///< of all files together
    uint32_t max_groups = 65536;
    float keep_below = 0.9f;  ///< fill of the map (MapHealth::fill) above which groups go
    float full = 0.95f;       ///< fill above which nothing comes back: the map would drop something else
    uint32_t slots = 32;      ///< groups on their way; each takes kMaxGroupRecordBytes
  };

  /// Memory that it takes at boot and keeps, for the plan.
  static uint64_t planned_bytes(const Options& options);
  /// @return an error that names the folder and what to do.  @thread boot
  static Result<std::unique_ptr<BlockArchive>> open(const Options& options);
  ~BlockArchive();
  BlockArchive(const BlockArchive&) = delete;
  BlockArchive& operator=(const BlockArchive&) = delete;

  /// After a frame was integrated.
  /// @param centre_map of the camera, metres  @return answers of the background thread that were taken
  /// @thread the engine's caller; does not allocate, wait or touch files
  uint32_t step(Engine& engine, Vec3 centre_map);
  /// A step of an earlier run once more: waits for as many answers as it took, and takes no others. They come
  /// in the order of what was asked for, so the map changes as it did then.
  /// @return false: they did not come.  @thread the engine's caller; waits
  bool repeat_step(Engine& engine, Vec3 centre_map, uint32_t answers);

  /// Boot: puts away until the map is below `keep_below`, or nothing more goes.
  /// @return what went wrong, else nothing.  @thread the engine's caller; waits
  std::string make_room(Engine& engine, Vec3 centre_map);

  /// The map was forgotten: what belonged to it is erased, a few files a step.
  /// @thread the engine's caller; does not allocate, wait or touch files
  void forget();

  const ArchiveCounters& counters() const { return counters_; }
  /// Keys of what is on disk, as many as fit. @return how many.  @thread the engine's caller
  uint32_t list(View<uint64_t> keys) const;
  /// @return bytes of the record; 0: it is not there just now, or does not fit.  @thread any; reads a file
  uint32_t copy(uint64_t key, View<uint8_t> record) const;
  /// The last failure: which file, and why; empty when there was none. @thread the engine's caller
  std::string last_error() const;

  /// Waits until what is on its way has arrived, then calls `f` with the record of every group on disk. A
  /// false answer of `f` ends it.
  /// @return what went wrong, else nothing.  @thread the engine's caller; waits and reads files
  std::string for_each(Engine& engine, const std::function<bool(View<const uint8_t> record)>& f);

 private:
  enum class EntryState : uint8_t { unused, storing, stored, loading, doomed };
  struct Entry {
    uint64_t key = 0;
    uint32_t bytes = 0;
    uint32_t map = 0;  ///< `map_` when it came
    EntryState state = EntryState::unused;
  };
  enum class Order : uint8_t { store, load, erase };
  struct Slot {
    Order order = Order::store;
    uint64_t key = 0;
    uint32_t map = 0;
    uint32_t entry = 0;
    uint32_t bytes = 0;  ///< of the record
    bool done = false;   ///< the answer: it worked
    std::vector<uint8_t> record;
  };

  BlockArchive(const Options& options, std::string folder, int lock);

  void order(Engine& engine, Vec3 centre_map);
  std::string settle(Engine& engine);
  void take_answer(Engine& engine, uint32_t number);
  void stored(Engine& engine, const Slot& slot);
  bool loaded(Engine& engine, const Slot& slot);
  bool send(Order order, uint32_t entry);
  void erase_doomed();
  void fetch_wanted(Engine& engine);
  void put_away_far(Engine& engine, Vec3 centre_map);
  bool put_away(Engine& engine, uint64_t key);
  void release(uint32_t entry);

  void work();
  struct Path {
    char text[512];
  };
  void path(uint32_t map, uint64_t key, Path& out) const;
  bool write(const Slot& slot);
  bool read(Slot& slot);
  bool erase(const Slot& slot);
  void note_error(const Path& name, const char* what, int error);

  const Options options_;
  const std::string folder_;
  const int lock_;  ///< file that shows others that the folder is in use
  std::vector<Entry> entries_;
  std::vector<uint32_t> free_entries_;
  std::vector<Slot> slots_;
  std::vector<uint32_t> free_slots_;
  std::vector<uint64_t> far_;  ///< to be put away, the nearest first
  std::vector<ArchivedGroup> wanted_;
  uint32_t far_left_ = 0;
  uint32_t pause_ = 0;            ///< frames until something is put away again
  bool near_view_ = false;        ///< `far_` is near the view: there is nothing farther
  std::atomic<uint32_t> map_{0};  ///< counts the maps that were forgotten
  uint32_t doomed_ = 0;           ///< entries
  uint32_t doomed_from_ = 0;      ///< where the search for them goes on
  ArchiveCounters counters_;

  BoundedQueue<uint32_t> orders_, answers_;  ///< numbers of slots
  std::atomic<bool> stopping_{false};
  mutable std::mutex error_mutex_;  ///< the loop does not take it
  char error_[1024] = "";
  std::thread worker_;
};

}  // namespace stillmap
