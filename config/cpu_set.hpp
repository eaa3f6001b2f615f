#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stillmap {

inline constexpr int32_t kMostCpus = 1024;

/// @return the CPUs of a set such as "0,2-3", ascending; nothing: it cannot be read, or names one from
/// kMostCpus on
std::vector<int32_t> parse_cpus(const std::string& text);

}  // namespace stillmap
