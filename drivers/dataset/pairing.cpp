#include "drivers/dataset/pairing.hpp"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <tuple>

namespace stillmap {
namespace {

/// More than this many stamps near to one other stamp are no recording; it bounds time and memory.
constexpr size_t kMaxCandidates = 16;

struct Candidate {
  int64_t distance_ns;
  size_t a, b;
};

}  // namespace

std::vector<std::pair<size_t, size_t>> pair_by_stamp(const std::vector<Stamp>& a, const std::vector<Stamp>& b,
                                                     int64_t max_ns) {
  std::vector<size_t> by_stamp(b.size());
  std::iota(by_stamp.begin(), by_stamp.end(), size_t{0});
  std::stable_sort(by_stamp.begin(), by_stamp.end(), [&](size_t x, size_t y) { return b[x] < b[y]; });

  std::vector<Candidate> candidates;
  for (size_t i = 0; i < a.size(); ++i) {
    const auto first_not_before = std::lower_bound(
        by_stamp.begin(), by_stamp.end(), a[i], [&](size_t index, Stamp stamp) { return b[index] < stamp; });
    size_t above = static_cast<size_t>(first_not_before - by_stamp.begin());
    size_t below = above;
    const auto distance = [&](size_t at) { return std::abs(b[by_stamp[at]].ns - a[i].ns); };
    for (size_t found = 0; found < kMaxCandidates; ++found) {
      const bool can_rise = above<by_stamp.size(), can_fall = below> 0;
      if (!can_rise && !can_fall) break;
      const bool rise = can_rise && (!can_fall || distance(above) <= distance(below - 1));
      const size_t at = rise ? above++ : --below;
      if (distance(at) > max_ns) break;
      candidates.push_back({distance(at), i, by_stamp[at]});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& x, const Candidate& y) {
    return std::tie(x.distance_ns, x.a, x.b) < std::tie(y.distance_ns, y.a, y.b);
  });

  std::vector<bool> a_taken(a.size()), b_taken(b.size());
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const Candidate& candidate : candidates) {
    if (a_taken[candidate.a] || b_taken[candidate.b]) continue;
    a_taken[candidate.a] = b_taken[candidate.b] = true;
    pairs.emplace_back(candidate.a, candidate.b);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace stillmap
