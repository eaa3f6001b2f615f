#pragma once

#include <cstdint>
#include <optional>

#include "config/config.hpp"
#include "runtime/archive/map_saver.hpp"
#include "runtime/executive/run_item.hpp"

namespace stillmap {

/// When the map is saved on the way: every record.map_every_s, when the camera was lost and the map may be
/// given up soon, and when asked for.
/// @thread real-time; neither allocates, waits nor touches files (the saver's own thread does)
class MapKeeper {
 public:
  /// @param engine, archive (may be null) outlive this.  @thread boot
  MapKeeper(std::string path, const Config& config, const Engine& engine, const BlockArchive* archive)
      : config_(config), saver_(std::move(path), engine, archive) {}

  /// After each frame. @return what there is to say
  RunEvent step(const FrameResult& result);
  /// The next step begins a save.
  void save_soon() { asked_ = true; }
  /// While the camera is lost: what was mapped is in the file.
  bool map_may_go() const { return !lost_map_wanted_ && !saving_; }

  MapSaver& saver() { return saver_; }

 private:
  bool due(const FrameResult& result);
  RunEvent progress(Stamp stamp);

  const Config config_;
  MapSaver saver_;
  std::optional<Stamp> due_;
  std::optional<Stamp> progress_due_;
  TrackingState last_state_ = TrackingState::good;
  bool lost_map_wanted_ = false;  ///< the camera was lost: what there is is to be saved
  bool asked_ = false;
  bool saving_ = false;  ///< a save began whose end was not told yet
};

}  // namespace stillmap
