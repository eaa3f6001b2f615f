#include "runtime/range/range_filter.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

float seconds_between(Stamp earlier, Stamp later) {
  return static_cast<float>(later.ns - earlier.ns) * 1e-9f;
}

}  // namespace

bool RangeFilter::follows(const Echo& later, const Echo& earlier) const {
  const float reach_m = kFastest_m_s * seconds_between(earlier.at, later.at) + kRounding_m;
  return std::abs(later.range_m - earlier.range_m) <= reach_m;
}

std::optional<float> RangeFilter::add(Stamp at, float range_m) {
  const Echo echo{at, range_m};
  // What is older than what a reading speaks for says nothing about now.
  if (count_ > 0 && seconds_between(last_.at, at) > sonar_.max_age_s) count_ = 0;
  if (count_ > 0 && !follows(echo, last_)) {
    const bool said_again = doubted_ && follows(echo, *doubted_);
    if (!said_again) {
      doubted_ = echo;
      return {};
    }
    count_ = 0;
    believe(*doubted_);
  }
  believe(echo);
  return median();
}

void RangeFilter::believe(const Echo& echo) {
  const int32_t most = std::clamp(sonar_.median, 1, kMostMedian);
  if (count_ == 0) next_ = 0;
  believed_[static_cast<size_t>(next_)] = echo;
  next_ = (next_ + 1) % most;
  count_ = std::min(count_ + 1, most);
  last_ = echo;
  doubted_.reset();
}

float RangeFilter::median() const {
  std::array<float, kMostMedian> sorted{};
  for (int32_t i = 0; i < count_; ++i)
    sorted[static_cast<size_t>(i)] = believed_[static_cast<size_t>(i)].range_m;
  std::sort(sorted.begin(), sorted.begin() + count_);
  return sorted[static_cast<size_t>((count_ - 1) / 2)];
}

}  // namespace stillmap
