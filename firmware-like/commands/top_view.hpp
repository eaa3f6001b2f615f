#pragma once

#include <optional>
#include <string>

#include "runtime/ports/messages.hpp"

namespace stillmap {

/// What `stillmap top` knows at a moment.
struct TopView {
  std::string url;
  bool connected = true;  ///< a network has a route to the group
  double seconds = 0;     ///< since it listens
  std::optional<StatusMessage> status;
  std::optional<PoseMessage> pose;
  std::optional<RangeMessage> range;
  double status_age_s = 0, pose_age_s = 0, range_age_s = 0;  ///< since the last one came
  double poses_per_s = 0;                                    ///< of late
  uint32_t foreign = 0;  ///< messages on our channels that are none of ours
};

/// After this time without a status there is nothing to be heard.
inline constexpr double kSilenceS = 2;

/// All of it, in lines ended by \n.  @thread any
std::string top_screen(const TopView& view);
/// The most of it in one line, without its end.  @thread any
std::string top_line(const TopView& view);

}  // namespace stillmap
