#pragma once

#include <string>

#include "kernels/engine.hpp"
#include "runtime/archive/block_archive.hpp"

namespace stillmap {

/// The mesh of all that was mapped, in memory and in the archive: the same bytes as of a map that never had
/// to put anything away. Copies both into a file in `dir` and extracts from there, so that the pages of a map
/// larger than the memory can leave it.
/// @return what went wrong, else nothing.  @thread the engine's caller, after the loop
std::string extract_whole_mesh(Engine& engine, BlockArchive& archive, const EngineParams& params,
                               const std::string& dir, MeshSink& sink);

}  // namespace stillmap
