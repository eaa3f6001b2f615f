#pragma once

// What the `evaluate` commands print: text with the names of the TUM benchmark's scripts, or JSON.

#include <string>

#include "runtime/evaluate/ate.hpp"
#include "runtime/evaluate/model.hpp"
#include "runtime/evaluate/rpe.hpp"

namespace stillmap {

std::string ate_text(const AteResult& result);
std::string ate_json(const AteResult& result);
std::string rpe_text(const RpeResult& result, double delta_s);
std::string rpe_json(const RpeResult& result, double delta_s);
std::string model_text(const ModelResult& result);
std::string model_json(const ModelResult& result);

}  // namespace stillmap
