#pragma once

#include <cstdint>

#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/base/status.hpp"
#include "kernels/base/view.hpp"
#include "kernels/engine.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Scratch memory that `extract_mesh` needs: 13 bytes a block and about 2 MB.
uint64_t extract_scratch_bytes(uint32_t pool_blocks);

/// Welded coloured mesh of the zero level; the same bytes for the same voxels, whatever ids the blocks have
/// and however many threads there are. Allocates nothing.
/// @param scratch extract_scratch_bytes(map.block_keys.size) or more, at a multiple of 64; no content is kept
/// @return capacity_exhausted: scratch too small, or more than 2^32 - 1 vertices (nothing was sent then);
///         unavailable: the sink refused
/// @thread the engine's caller
Status extract_mesh(const VolumeView& map, MeshSink& sink, View<uint8_t> scratch, ThreadPool& threads);

}  // namespace stillmap
