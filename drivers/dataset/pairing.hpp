#pragma once

#include <utility>
#include <vector>

#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Pairs two lists of stamps, the nearest two first, each stamp at most once (the association of the TUM
/// benchmark).
/// @param max_ns largest distance of a pair, itself allowed
/// @return indices into `a` and `b`, in the order of `a`
std::vector<std::pair<size_t, size_t>> pair_by_stamp(const std::vector<Stamp>& a, const std::vector<Stamp>& b,
                                                     int64_t max_ns);

}  // namespace stillmap
