#include "kernels/backend/cpu/arena.hpp"

#include <sys/mman.h>

#include <cassert>

namespace stillmap {

Arena::Arena(uint64_t bytes) : size_(bytes) {
  void* memory =
      mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) {
    failed_ = true;
    return;
  }
  base_ = static_cast<std::byte*>(memory);
}

Arena::~Arena() {
  if (base_) munmap(base_, size_);
}

void* Arena::take_bytes(const char* name, uint64_t bytes) {
  const uint64_t align = bytes >= 4096 ? 4096 : 64;
  const uint64_t begin = (used_ + align - 1) / align * align;
  note(name, begin + bytes - used_);
  used_ = begin + bytes;
  if (measuring()) return nullptr;
  assert(used_ <= size_);
  return base_ + begin;
}

void Arena::note(const char* name, uint64_t bytes) {
  items_.total_bytes += bytes;
  for (uint32_t i = 0; i < items_.count; ++i)
    if (std::strcmp(items_.item[i].name, name) == 0) {
      items_.item[i].bytes += bytes;
      return;
    }
  assert(items_.count < kMaxMemoryItems);
  items_.item[items_.count++] = {name, bytes};
}

}  // namespace stillmap
