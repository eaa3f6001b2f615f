#pragma once

#include <cstddef>
#include <cstdint>

namespace stillmap {

/// CRC-32C (Castagnoli, as in iSCSI and ext4) of bytes that follow those of `before`.   test: crc32c_test
/// @param before 0 at the start, else the answer for all bytes so far
uint32_t crc32c(const void* bytes, size_t count, uint32_t before = 0);

}  // namespace stillmap
