#pragma once

// Numbers in text that comes from outside: the same reading for recordings, trajectories and the command
// line.

#include <optional>
#include <string_view>

#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Exact nanoseconds of a decimal number of seconds ("1305031229.4331", "1.305e9"); digits below 1 ns are
/// rounded.
/// @return nothing when the text is no number or lies beyond 100 years.   test: number_text_test
std::optional<Stamp> parse_stamp(std::string_view text);

/// A finite number, the whole of `text`; nothing otherwise.
std::optional<double> parse_number(std::string_view text);

}  // namespace stillmap
