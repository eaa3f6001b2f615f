#pragma once

#include <cstdint>

namespace stillmap {

/// What a call after boot answers instead of throwing.
enum class Status : uint8_t {
  ok,
  end,                 ///< a source has no more frames
  timeout,             ///< nothing came within the time given
  bad_data,            ///< this frame cannot be used; the next may
  capacity_exhausted,  ///< a fixed table, pool or budget is full
  degenerate,          ///< too few points or a singular system: the pose is unchanged
  unavailable,         ///< device or file is gone or was never there
  out_of_range         ///< an argument is outside its documented range
};

/// @return a short lower-case name for messages.  @thread any
constexpr const char* to_string(Status s) {
  switch (s) {
    case Status::ok:
      return "ok";
    case Status::end:
      return "end";
    case Status::timeout:
      return "timeout";
    case Status::bad_data:
      return "bad data";
    case Status::capacity_exhausted:
      return "capacity exhausted";
    case Status::degenerate:
      return "degenerate";
    case Status::unavailable:
      return "unavailable";
    case Status::out_of_range:
      return "out of range";
  }
  return "unknown";
}

}  // namespace stillmap
