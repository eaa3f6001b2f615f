#pragma once

// What several subcommands do: read and check a configuration, open a source, hold one frame.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/memory_plan.hpp"
#include "config/result.hpp"
#include "drivers/registry.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/executive/frame_slots.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// The configuration of a file ("": the defaults, which are config/presets/default.toml) with `settings`
/// ("section.key=value") laid over it. Not yet checked.
Result<Config> read_config(const std::string& path, const std::vector<std::string>& settings);

/// @return an error of kind bad_usage that lists every violation, one a line
Result<Done> check(const Config& config);

/// Of the memory plan, where depth is still to be registered.
constexpr const char* kRegistrationEntry = "registration of depth to colour";

/// What camera.calibration says; empty where there is none.
Result<Calibration> configured_calibration(const Config& config);

/// Where far parts of the map go, as the configuration says.
BlockArchive::Options archive_options(const Config& config);

/// All memory of a run: the engine, the frames, archive and saving of the map where they are asked for.
/// @param device as pick_device answers
MemoryPlan plan_memory(const Config& config, const EngineParams& params, const std::string& device = "cpu");

/// What a source has to be told: the camera and the stamps where the configuration overrides them.
SourceOptions source_options(const Config& config);

using PreloadedFrames = std::vector<std::unique_ptr<FrameSlot>>;
/// Reads up to `count` usable frames: decoding and rendering must not disturb a measurement.
PreloadedFrames preload(FrameSource& source, int32_t count);

}  // namespace stillmap
