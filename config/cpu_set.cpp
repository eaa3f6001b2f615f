#include "config/cpu_set.hpp"

#include <algorithm>
#include <charconv>
#include <string_view>

namespace stillmap {
namespace {

/// Advances past a number. @return -1: there is none, or it is too large
int32_t read_cpu(std::string_view& text) {
  int32_t cpu = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), cpu);
  if (error != std::errc() || cpu < 0 || cpu >= kMostCpus) return -1;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return cpu;
}

bool skip(std::string_view& text, char c) {
  if (text.empty() || text.front() != c) return false;
  text.remove_prefix(1);
  return true;
}

}  // namespace

std::vector<int32_t> parse_cpus(const std::string& text) {
  std::vector<int32_t> cpus;
  std::string_view left = text;
  do {
    const int32_t first = read_cpu(left);
    const int32_t last = skip(left, '-') ? read_cpu(left) : first;
    if (first < 0 || last < first) return {};
    for (int32_t cpu = first; cpu <= last; ++cpu) cpus.push_back(cpu);
  } while (skip(left, ','));
  if (!left.empty()) return {};
  std::sort(cpus.begin(), cpus.end());
  cpus.erase(std::unique(cpus.begin(), cpus.end()), cpus.end());
  return cpus;
}

}  // namespace stillmap
