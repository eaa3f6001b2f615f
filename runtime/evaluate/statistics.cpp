#include "runtime/evaluate/statistics.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {

Statistics statistics_of(std::vector<double> values) {
  Statistics s;
  s.count = values.size();
  if (values.empty()) return s;
  std::sort(values.begin(), values.end());
  const double n = static_cast<double>(values.size());
  double sum = 0, squares = 0;
  for (const double v : values) {
    sum += v;
    squares += v * v;
  }
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  double deviation = 0;
  for (const double v : values) deviation += (v - s.mean) * (v - s.mean);
  s.std = std::sqrt(deviation / n);
  const std::size_t middle = values.size() / 2;
  s.median = values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
  s.min = values.front();
  s.max = values.back();
  return s;
}

}  // namespace stillmap
