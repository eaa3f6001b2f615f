#pragma once

#include "kernels/raycast/raycast_pass.hpp"

namespace stillmap {

/// Rows [first, last) of a view; 16 rows at a time are about right.
/// @thread any; different rows at the same time
void raycast_rows(const RaycastPass& pass, int32_t first_row, int32_t last_row);

}  // namespace stillmap
