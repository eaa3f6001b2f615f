#include "runtime/record/histogram.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {

void DurationHistogram::add(double ms) {
  if (!std::isfinite(ms) || ms < 0) return;
  min_ = count_ == 0 ? ms : std::min(min_, ms);
  max_ = std::max(max_, ms);
  sum_ += ms;
  ++count_;
  const double bin = ms <= kSmallestMs ? 0.0 : std::log(ms / kSmallestMs) / std::log(kBinRatio);
  ++bins_[std::min(static_cast<uint32_t>(bin), kBins - 1)];
}

double DurationHistogram::mean() const {
  return count_ == 0 ? 0.0 : sum_ / static_cast<double>(count_);
}

double DurationHistogram::percentile(double share) const {
  if (count_ == 0) return 0;
  const auto wanted =
      std::clamp<uint64_t>(static_cast<uint64_t>(std::ceil(share * static_cast<double>(count_))), 1, count_);
  uint64_t seen = 0;
  uint32_t bin = 0;
  while ((seen += bins_[bin]) < wanted) ++bin;
  const double middle = kSmallestMs * std::pow(kBinRatio, static_cast<double>(bin) + 0.5);
  return std::clamp(middle, min_, max_);
}

}  // namespace stillmap
