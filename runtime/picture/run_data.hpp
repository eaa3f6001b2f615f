#pragma once

// What a run left in its folder, as far as pictures need it.

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

enum class FrameState : uint8_t { good, poor, lost };

/// A line of states.csv.
struct StateRow {
  Stamp stamp;
  FrameState state = FrameState::good;
  double inlier_ratio = 0, masked_fraction = 0;
};

inline constexpr std::size_t kStages = 5;
inline constexpr std::array<const char*, kStages> kStageNames = {"prepare", "track", "mask", "refine",
                                                                 "integrate"};

/// A line of timing.csv.
struct TimingRow {
  std::array<double, kStages> stage_ms{};
  double total_ms = 0;
};

/// A frame that the run kept: paths of its images, empty where one is missing.
struct Snapshot {
  std::string stamp, colour, mask, map;
};

/// @return an error naming file and line for what is not as the run writes it
Result<std::vector<StateRow>> read_states(const std::string& path);
Result<std::vector<TimingRow>> read_timing(const std::string& path);

/// By stamp; only those with a colour image.
std::vector<Snapshot> find_snapshots(const std::string& dir);

/// A path that is a regular file.
bool have_file(const std::string& path);

}  // namespace stillmap
