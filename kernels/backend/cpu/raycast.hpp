#pragma once

#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/base/status.hpp"
#include "kernels/raycast/raycast_pass.hpp"

namespace stillmap {

/// Rows [first, last) of a view. Costs most by far.
/// @thread any; different rows at the same time
void raycast_rows(const RaycastPass& pass, int32_t first_row, int32_t last_row);

/// Scratch memory of `raycast`, whatever the size of the view and of the map.
uint64_t raycast_scratch_bytes();

/// The whole view. `pass.ranges` is made here. Allocates nothing; the same bytes for any number of threads.
/// @param scratch raycast_scratch_bytes() or more, at a multiple of 8
/// @return out_of_range: images and intrinsics differ in size, are empty or wider than 32767 pixels, or
/// scratch is too
///         small
/// @thread the engine's caller
Status raycast(RaycastPass pass, View<uint8_t> scratch, ThreadPool& threads);

}  // namespace stillmap
