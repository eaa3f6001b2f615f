#pragma once

#include <memory>
#include <string>

#include "kernels/engine.hpp"

namespace stillmap {

/// What --device picks: cpu or cuda as it says; with "auto" the CPU engine, as long as the CUDA engine has
/// not been proven on a device. A program that has the CUDA engine then says once, on stderr, why it does not
/// take it, unless it is to be quiet.
/// @param wanted auto, cuda or cpu; see cuda_refused for cuda  @thread boot
std::string pick_device(const std::string& wanted, bool quiet);

/// Why `--device cuda` cannot be had here, and what to do; "" when it can, or is not asked for.  @thread boot
std::string cuda_refused(const std::string& wanted);

/// The plan, and the engine, of a device that pick_device answered.  @thread boot
MemoryItems plan_engine(const std::string& device, const EngineParams& params);
std::unique_ptr<Engine> make_engine(const std::string& device, const EngineParams& params);

}  // namespace stillmap
