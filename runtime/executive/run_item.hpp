#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include "runtime/archive/block_archive.hpp"
#include "runtime/core/bounded_queue.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// What the real-time thread tells the record thread besides frames; put into words there.
struct RunEvent {
  enum class Kind : uint8_t { none, new_map, map_save_progress, map_saved, map_save_failed, reset };
  Kind kind = Kind::none;
  Stamp stamp;
  double seconds = 0;   ///< new_map: lost for; map_saved: it took
  uint64_t done = 0;    ///< groups copied; map_saved: bytes of the file
  uint64_t of = 0;      ///< groups of the map
  char text[240] = {};  ///< map_save_failed: why

  void set_text(const char* from) { std::strncpy(text, from, sizeof(text) - 1); }
};

/// One item on its way to the record thread: a frame, an event, or both.
struct RunItem {
  static constexpr int32_t kNoSlot = -1;

  bool has_frame = false;
  FrameResult result;
  int32_t slot = kNoSlot;  ///< images of the frame; the record thread gives it back
  std::optional<Se3d> truth_T_world_cam;
  uint32_t shed = 0;  ///< Shed, while it was worked on
  uint32_t dropped_before = 0;
  PipelineCounters counters;
  ArchiveCounters archive;
  RunEvent event;
};

/// One item on its way to the publish thread.
struct PublishItem {
  FrameResult result;
  bool whole = false;  ///< false: the pose is known, the frame is not done
  uint32_t pose_epoch = 0;
  uint64_t map_id = 0;
};

/// A line for the events log from a thread that may put things into words.
struct Notice {
  enum class Kind : uint8_t { info, warning, fault };
  Kind kind = Kind::info;
  Stamp stamp;  ///< of the source's clock: the frame it is about, or the last one
  char name[32] = {};
  char text[240] = {};  ///< what is longer is cut

  static Notice make(Kind kind, Stamp stamp, std::string_view name, std::string_view text) {
    Notice notice{kind, stamp, {}, {}};
    std::memcpy(notice.name, name.data(), std::min(name.size(), sizeof(notice.name) - 1));
    std::memcpy(notice.text, text.data(), std::min(text.size(), sizeof(notice.text) - 1));
    return notice;
  }
};

using NoticeQueue = BoundedQueue<Notice>;
using RunQueue = BoundedQueue<RunItem>;
using PublishQueue = BoundedQueue<PublishItem>;

}  // namespace stillmap
